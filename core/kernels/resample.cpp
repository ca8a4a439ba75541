#include "core/kernels/resample.h"

#include <algorithm>
#include <vector>

#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

template <class T>
std::vector<T> weights_as(const ResampleMatrix& matrix) {
    std::vector<T> result;
    for (const double weight : matrix.weights()) result.push_back(static_cast<T>(weight));
    return result;
}

/// y (rows of `length`) = sum over the matrix row's entries of weight * x row.
template <class T>
void combine(const T* x, T* y, const ResampleMatrix& matrix, const std::vector<T>& weights, std::int64_t row,
             std::int64_t length) {
    const auto begin = static_cast<std::size_t>(matrix.begins()[static_cast<std::size_t>(row)]);
    const auto end = static_cast<std::size_t>(matrix.begins()[static_cast<std::size_t>(row) + 1]);
    if (begin == end) std::fill_n(y, length, T(0));
    for (std::size_t entry = begin; entry < end; ++entry) {
        const T* from = x + matrix.columns()[entry] * length;
        const T weight = weights[entry];
        if (entry == begin) {
            for (std::int64_t i = 0; i < length; ++i) y[i] = weight * from[i];
        } else {
            for (std::int64_t i = 0; i < length; ++i) y[i] += weight * from[i];
        }
    }
}

}  // namespace

Tensor resample(const Tensor& x, const ResampleMatrix& vertical, const ResampleMatrix& horizontal) {
    const std::int64_t in_width = x.shape(2);
    const std::int64_t channels = x.shape(3);
    const std::int64_t out_height = vertical.output_length();
    const std::int64_t out_width = horizontal.output_length();
    Tensor y({x.shape(0), out_height, out_width, channels}, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const std::vector<T> vertical_weights = weights_as<T>(vertical);
        const std::vector<T> horizontal_weights = weights_as<T>(horizontal);
        const std::int64_t grain = std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, out_width * channels));
        parallel_for(x.shape(0) * out_height, grain, [&](std::int64_t begin, std::int64_t end) {
            std::vector<T> line(static_cast<std::size_t>(in_width * channels));
            for (std::int64_t row = begin; row < end; ++row) {
                const T* image = in + row / out_height * x.shape(1) * in_width * channels;
                combine(image, line.data(), vertical, vertical_weights, row % out_height, in_width * channels);
                T* to = out + row * out_width * channels;
                for (std::int64_t column = 0; column < out_width; ++column) {
                    combine(line.data(), to + column * channels, horizontal, horizontal_weights, column, channels);
                }
            }
        });
    });
    return y;
}

}  // namespace stymo::kernels
