#include "nn/known_pixels.h"

#include <cmath>

#include "core/ops/ops.h"

namespace stymo {

namespace {

/// 1 for each pixel to which resize_bicubic gives a weight.
ResampleMatrix contributions(std::int64_t output_length, std::int64_t input_length) {
    constexpr double rounding = 1e-9;
    const ResampleMatrix weights =
        bicubic_matrix(static_cast<int>(output_length), static_cast<int>(input_length));
    std::vector<ResampleMatrix::Entry> entries;
    for (int row = 0; row < weights.output_length(); ++row)
        for (auto i = static_cast<std::size_t>(weights.begins()[static_cast<std::size_t>(row)]);
             i < static_cast<std::size_t>(weights.begins()[static_cast<std::size_t>(row) + 1]); ++i)
            if (std::abs(weights.weights()[i]) > rounding)
                entries.push_back({row, weights.columns()[i], 1.0});
    return {weights.output_length(), weights.input_length(), std::move(entries)};
}

}  // namespace

Tensor known_at(const Tensor& known, std::int64_t height, std::int64_t width) {
    if (!known.defined()) return known;
    const int first = known.rank() - 3;
    const std::int64_t rows = known.shape(first), columns = known.shape(first + 1);
    if (rows == height && columns == width) return known;
    const std::int64_t count = known.size() / (rows * columns);
    const Variable unknown = resample(affine(known.reshaped({count, rows, columns, 1}), -1.0, 1.0),
                                      contributions(height, rows), contributions(width, columns));
    const Tensor zeros = Tensor::zeros(unknown.shape(), known.dtype());
    const Tensor ones = Tensor::full(unknown.shape(), 1.0, known.dtype());
    const Tensor result = where(unknown.value(), zeros, ones).value();
    return known.rank() == 3 ? result.reshaped({height, width, 1}) : result;
}

Variable where_known(const Tensor& known, const Variable& images, const Variable& other) {
    return known.defined() ? where(known.to(images.dtype()), images, other) : images;
}

Variable where_known(const Tensor& known, const Variable& images, double other) {
    return where_known(known, images, Tensor::scalar(other, images.dtype()));
}

double known_share(const Tensor& known) {
    return known.defined() ? mean(Variable(known)).value().item() : 1.0;
}

Tensor unless_all_known(const Tensor& known) {
    return known_share(known) < 1.0 ? known : Tensor();
}

}  // namespace stymo
