#include "nn/known_pixels.h"

#include <algorithm>
#include <cmath>

#include "core/ops/ops.h"

namespace stymo {

namespace {

bool has_zero(const Tensor& values) {
    return dispatch(values.dtype(), [&]<class T>(T zero) {
        return std::ranges::find(values.values<T>(), zero) != values.values<T>().end();
    });
}

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

/// Unknown pixels become the mean of the known ones in the smallest block of 2, 4, 8, ... pixels
/// that has any, smoothly.
Tensor spread(const Tensor& known, const Tensor& images) {
    const Tensor weight = broadcast_to(known, images.shape()).value();
    const int side = static_cast<int>(images.shape(1)), half = side / 2;
    const bool last = side % 2 != 0;
    const auto shrunk = [&](const Variable& x) {
        return last ? mean(x, {1, 2}) : resize_box(x, half, half);
    };
    const Variable area = shrunk(Variable(known));
    const Tensor ones = Tensor::full(area.shape(), 1.0, known.dtype());
    const Tensor means =
        (shrunk(Variable(images) * weight) / where(area.value(), area, ones)).value();
    const Tensor found = where(area.value(), ones, area).value();
    const bool complete = last || !has_zero(found);
    const Variable coarse = complete ? means : spread(found, means);
    return where(weight, images, resize_bilinear(coarse, side, side)).value();
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

Tensor with_guesses(const Tensor& known, const Tensor& images) {
    if (!known.defined()) return images;
    const Tensor own = known.to(images.dtype());
    const Variable mirrored_known = flip(own, 2);
    const Tensor both = maximum(own, mirrored_known).value();
    return spread(both, where(own, images, flip(images, 2)).value());
}

double known_share(const Tensor& known) {
    return known.defined() ? mean(Variable(known)).value().item() : 1.0;
}

Tensor unless_all_known(const Tensor& known) {
    return known.defined() && has_zero(known) ? known : Tensor();
}

}  // namespace stymo
