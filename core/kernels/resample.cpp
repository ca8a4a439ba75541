#include "core/kernels/resample.h"

#include <algorithm>
#include <array>
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

/// y (+)= sum over so many entries from `entry` on of weight * x row, in one pass over y.
template <int count, class T>
void combine_some(const T* x, T* y, const ResampleMatrix& matrix, const std::vector<T>& weights,
                  std::size_t entry, bool add, std::int64_t length) {
    std::array<const T*, count> from;
    std::array<T, count> weight;
    for (std::size_t k = 0; k < count; ++k) {
        from[k] = x + matrix.columns()[entry + k] * length;
        weight[k] = weights[entry + k];
    }
    const auto sum_at = [=](std::int64_t i, T sum) {
        for (std::size_t k = 0; k < count; ++k) sum += weight[k] * from[k][i];
        return sum;
    };
    if (add) {
#pragma omp simd
        for (std::int64_t i = 0; i < length; ++i) y[i] = sum_at(i, y[i]);
    } else {
#pragma omp simd
        for (std::int64_t i = 0; i < length; ++i) y[i] = sum_at(i, T(0));
    }
}

/// y (rows of `length`) = sum over the matrix row's entries of weight * x row.
template <class T>
void combine(const T* x, T* y, const ResampleMatrix& matrix, const std::vector<T>& weights,
             std::int64_t row, std::int64_t length) {
    const auto begin = static_cast<std::size_t>(matrix.begins()[static_cast<std::size_t>(row)]);
    const auto end = static_cast<std::size_t>(matrix.begins()[static_cast<std::size_t>(row) + 1]);
    if (begin == end) std::fill_n(y, length, T(0));
    for (std::size_t entry = begin; entry < end;) {
        const std::size_t count = std::min<std::size_t>(end - entry, 4);
        const bool add = entry > begin;
        if (count == 4) combine_some<4>(x, y, matrix, weights, entry, add, length);
        if (count == 3) combine_some<3>(x, y, matrix, weights, entry, add, length);
        if (count == 2) combine_some<2>(x, y, matrix, weights, entry, add, length);
        if (count == 1) combine_some<1>(x, y, matrix, weights, entry, add, length);
        entry += count;
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
        const std::int64_t grain = std::max<std::int64_t>(
            1, elementwise_grain / std::max<std::int64_t>(1, out_width * channels));
        parallel_for(x.shape(0) * out_height, grain, [&](std::int64_t begin, std::int64_t end) {
            std::vector<T> line(static_cast<std::size_t>(in_width * channels));
            for (std::int64_t row = begin; row < end; ++row) {
                const T* image = in + row / out_height * x.shape(1) * in_width * channels;
                combine(image, line.data(), vertical, vertical_weights, row % out_height,
                        in_width * channels);
                T* to = out + row * out_width * channels;
                for (std::int64_t column = 0; column < out_width; ++column) {
                    combine(line.data(), to + column * channels, horizontal, horizontal_weights,
                            column, channels);
                }
            }
        });
    });
    return y;
}

}  // namespace stymo::kernels
