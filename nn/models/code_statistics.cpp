#include "nn/models/code_statistics.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/ops/ops.h"
#include "core/tensor_eigen.h"

namespace stymo {

namespace {

constexpr const char* faces_name = "codes.faces";
constexpr const char* mean_name = "codes.mean";
constexpr const char* factor_name = "codes.factor";

/// The lower triangular L with L L^T = X^T X for the rows X: the transpose of R in X = Q R. If
/// there are fewer rows than columns, only as many columns of L as there are rows are not 0.
RowMajorMatrix<double> cholesky_factor(const RowMajorMatrix<double>& rows) {
    const Eigen::MatrixXd packed = Eigen::HouseholderQR<Eigen::MatrixXd>(rows).matrixQR();
    const Eigen::Index rank = std::min(rows.rows(), rows.cols());
    RowMajorMatrix<double> factor = RowMajorMatrix<double>::Zero(rows.cols(), rows.cols());
    factor.leftCols(rank) =
        packed.topRows(rank).triangularView<Eigen::Upper>().toDenseMatrix().transpose();
    // R is unique up to the signs of its rows.
    for (Eigen::Index k = 0; k < rank; ++k)
        if (factor(k, k) < 0.0) factor.col(k) *= -1.0;
    return factor;
}

const Tensor& member(const TensorFile& file, const char* name, const Shape& shape,
                     const std::string& source) {
    const auto found = file.tensors.find(name);
    if (found == file.tensors.end())
        fail<FileError>(source, ": has ", mean_name, " but no tensor ", name);
    if (!(found->second.shape() == shape))
        fail<FileError>(source, ": ", name, " has shape ", found->second.shape(), " instead of ",
                        shape);
    if (!found->second.all_finite())
        fail<FileError>(source, ": ", name, " holds values that are not finite");
    return found->second;
}

}  // namespace

CodeStatistics::CodeStatistics(std::int64_t faces, Tensor mean, Tensor factor)
    : faces_(faces), mean_(std::move(mean)), factor_(std::move(factor)) {}

CodeStatistics CodeStatistics::of(const Codes& codes) {
    const std::int64_t faces = codes.batch();
    if (faces < 2) fail<ValueError>("statistics of codes need two faces or more, got ", faces);
    const Tensor all = joined(codes).value();
    if (!all.all_finite()) fail<NumericError>("statistics of codes: a code is not finite");
    RowMajorMatrix<double> rows = matrix_map<float>(all.to(DType::float32)).cast<double>();
    const Eigen::RowVectorXd center = rows.colwise().mean();
    rows.rowwise() -= center;
    rows /= std::sqrt(static_cast<double>(faces - 1));
    return {faces, tensor_from(center).to(DType::float32),
            tensor_from(cholesky_factor(rows)).to(DType::float32)};
}

std::optional<CodeStatistics> CodeStatistics::load(const TensorFile& file,
                                                   const std::string& source) {
    if (!file.tensors.contains(mean_name)) return std::nullopt;
    const double faces = member(file, faces_name, {}, source).item();
    return CodeStatistics(
        std::llround(faces), member(file, mean_name, {code_size}, source).to(DType::float32),
        member(file, factor_name, {code_size, code_size}, source).to(DType::float32));
}

void CodeStatistics::save(TensorFile& file) const {
    file.tensors[faces_name] = Tensor::scalar(static_cast<double>(faces_));
    file.tensors[mean_name] = mean_;
    file.tensors[factor_name] = factor_;
}

Codes CodeStatistics::sample(Rng& rng, double truncation) const {
    constexpr double most = 10.0;
    if (!(truncation >= 0.0 && truncation <= most))
        fail<ValueError>("the truncation of a new face must be from 0 to ", most, ", not ",
                         truncation);
    const Variable normal = rng.normal({1, code_size}, 0.0, truncation);
    return split_codes(mean_ + matmul(normal, factor_, {.transpose_b = true}));
}

Codes CodeStatistics::new_face(std::uint64_t seed, std::uint64_t index, double truncation) const {
    Rng rng = Rng(seed).split("new faces").split(index);
    return sample(rng, truncation);
}

}  // namespace stymo
