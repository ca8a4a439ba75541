#include "nn/models/code_statistics.h"

#include <cmath>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {

namespace {

constexpr const char* faces_name = "codes.faces";
constexpr const char* mean_name = "codes.mean";
constexpr const char* factor_name = "codes.factor";
/// Part of a number's variance below which what is left of it is rounding: it depends on the numbers before it.
constexpr double dependent = 1e-10;

/// L, lower triangular, with L L^T = covariance (n, n), which may be singular: a number that depends on those before it has no
/// column of its own.
Tensor cholesky_factor(const Tensor& covariance) {
    const auto size = static_cast<std::size_t>(covariance.shape(0));
    std::vector<double> rest = covariance.to_vector();
    Tensor result = Tensor::zeros(covariance.shape(), DType::float64);
    const std::span<double> factor = result.mutable_values<double>();
    for (std::size_t k = 0; k < size; ++k) {
        const double pivot = rest[k * size + k];
        if (pivot <= dependent * covariance.values<double>()[k * size + k]) continue;
        const double root = std::sqrt(pivot);
        for (std::size_t i = k; i < size; ++i) factor[i * size + k] = rest[i * size + k] / root;
        for (std::size_t i = k + 1; i < size; ++i) {
            for (std::size_t j = k + 1; j <= i; ++j) rest[i * size + j] -= factor[i * size + k] * factor[j * size + k];
        }
    }
    return result;
}

const Tensor& member(const TensorFile& file, const char* name, const Shape& shape, const std::string& source) {
    const auto found = file.tensors.find(name);
    if (found == file.tensors.end()) fail<FileError>(source, ": has ", mean_name, " but no tensor ", name);
    if (!(found->second.shape() == shape))
        fail<FileError>(source, ": ", name, " has shape ", found->second.shape(), " instead of ", shape);
    if (!found->second.all_finite()) fail<FileError>(source, ": ", name, " holds values that are not finite");
    return found->second;
}

}  // namespace

CodeStatistics::CodeStatistics(std::int64_t faces, Tensor mean, Tensor factor)
    : faces_(faces), mean_(std::move(mean)), factor_(std::move(factor)) {}

CodeStatistics CodeStatistics::of(const Codes& codes) {
    const std::int64_t faces = codes.batch();
    if (faces < 2) fail<ValueError>("statistics of codes need two faces or more, got ", faces);
    const Variable rows = Variable(joined(codes).value().to(DType::float64));
    if (!rows.value().all_finite()) fail<NumericError>("statistics of codes: a code is not finite");
    const Variable center = stymo::mean(rows, {0});
    const Variable difference = rows - center;
    const Variable covariance = matmul(difference, difference, {.transpose_a = true}) * (1.0 / static_cast<double>(faces - 1));
    return {faces, center.value().reshaped({code_size}).to(DType::float32),
            cholesky_factor(covariance.value()).to(DType::float32)};
}

std::optional<CodeStatistics> CodeStatistics::load(const TensorFile& file, const std::string& source) {
    if (!file.tensors.contains(mean_name)) return std::nullopt;
    const double faces = member(file, faces_name, {}, source).item();
    return CodeStatistics(std::llround(faces), member(file, mean_name, {code_size}, source).to(DType::float32),
                          member(file, factor_name, {code_size, code_size}, source).to(DType::float32));
}

void CodeStatistics::save(TensorFile& file) const {
    file.tensors[faces_name] = Tensor::scalar(static_cast<double>(faces_));
    file.tensors[mean_name] = mean_;
    file.tensors[factor_name] = factor_;
}

Codes CodeStatistics::sample(Rng& rng, double truncation) const {
    const Variable normal = rng.normal({1, code_size}, 0.0, truncation);
    return split_codes(mean_ + matmul(normal, factor_, {.transpose_b = true}));
}

}  // namespace stymo
