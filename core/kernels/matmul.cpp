#include "core/kernels/matmul.h"

#include <Eigen/Core>
#include <algorithm>
#include <numbers>
#include <vector>

#include "core/kernels/fast_math.h"
#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

template <class T>
using RowMajor = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Rows of one tile: enough to pay for packing the right operand, few enough that the tile's result stays in cache.
constexpr std::int64_t tile_rows = 512;
/// The same for a transposed left operand, whose columns are the rows of the result: channels, of which there are few.
constexpr std::int64_t transposed_tile_rows = 128;
/// Length of one piece of a long inner sum; the pieces are added in order.
constexpr std::int64_t inner_piece = 8192;

struct Extents {
    std::int64_t batch, m, n, k;
};

/// Few result elements and a long inner sum (weight gradients): pieces of the sum in parallel, added in a fixed order.
template <class T>
void multiply_long_inner(const T* a, const T* b, T* c, const Extents& e, MatmulOptions options) {
    const std::int64_t pieces = chunk_count(e.k, inner_piece);
    std::vector<T> partial(static_cast<std::size_t>(pieces * e.m * e.n));
    parallel_for(pieces, 1, [&](std::int64_t piece, std::int64_t) {
        const std::int64_t first = piece * inner_piece;
        const std::int64_t length = std::min(inner_piece, e.k - first);
        // Only a transposed left and a plain right operand have contiguous pieces of the inner axis.
        multiply_into(partial.data() + piece * e.m * e.n, a + first * e.m, b + first * e.n, e.m, e.n, length, options, false);
    });
    for (std::int64_t i = 0; i < e.m * e.n; ++i) {
        T total = T(0);
        for (std::int64_t piece = 0; piece < pieces; ++piece) total += partial[static_cast<std::size_t>(piece * e.m * e.n + i)];
        c[i] = total;
    }
}

template <class T>
void multiply_tiles(const T* a, const T* b, T* c, const Extents& e, std::int64_t stride_a, std::int64_t stride_b,
                    MatmulOptions options) {
    const std::int64_t rows = options.transpose_a ? transposed_tile_rows : tile_rows;
    const std::int64_t tiles = std::max<std::int64_t>(1, chunk_count(e.m, rows));
    const std::int64_t grain = std::max<std::int64_t>(1, 32768 / std::max<std::int64_t>(1, e.m * e.n * e.k / tiles));
    parallel_for(e.batch * tiles, grain, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t tile = begin; tile < end; ++tile) {
            const std::int64_t batch = tile / tiles;
            const std::int64_t first = tile % tiles * rows;
            const std::int64_t count = std::min(rows, e.m - first);
            const T* from = a + batch * stride_a + (options.transpose_a ? first : first * e.k);
            multiply_into(c + (batch * e.m + first) * e.n, from, b + batch * stride_b, count, e.n, e.k, options, false,
                          options.transpose_a ? e.m : e.k);
        }
    });
}

}  // namespace

template <class T>
void multiply_into(T* c, const T* a, const T* b, std::int64_t m, std::int64_t n, std::int64_t k, MatmulOptions options,
                   bool accumulate, std::int64_t stride_a) {
    using Map = Eigen::Map<const RowMajor<T>>;
    const std::int64_t left_columns = options.transpose_a ? m : k;
    const Eigen::Map<const RowMajor<T>, Eigen::Unaligned, Eigen::OuterStride<>> left(
        a, options.transpose_a ? k : m, left_columns, Eigen::OuterStride<>(stride_a == 0 ? left_columns : stride_a));
    const Map right(b, options.transpose_b ? n : k, options.transpose_b ? k : n);
    Eigen::Map<RowMajor<T>> result(c, m, n);
    if (!accumulate) result.setZero();
    if (options.transpose_a && options.transpose_b) {
        result.noalias() += left.transpose() * right.transpose();
    } else if (options.transpose_a) {
        result.noalias() += left.transpose() * right;
    } else if (options.transpose_b) {
        result.noalias() += left * right.transpose();
    } else {
        result.noalias() += left * right;
    }
}

template void multiply_into<float>(float*, const float*, const float*, std::int64_t, std::int64_t, std::int64_t, MatmulOptions,
                                   bool, std::int64_t);
template void multiply_into<double>(double*, const double*, const double*, std::int64_t, std::int64_t, std::int64_t,
                                    MatmulOptions, bool, std::int64_t);

Tensor matmul(const Tensor& a, const Tensor& b, MatmulOptions options) {
    const Extents e{std::max(a.shape(0), b.shape(0)), a.shape(options.transpose_a ? 2 : 1), b.shape(options.transpose_b ? 1 : 2),
                    a.shape(options.transpose_a ? 1 : 2)};
    Tensor c({e.batch, e.m, e.n}, a.dtype());
    dispatch(a.dtype(), [&]<class T>(T) {
        const T* in_a = a.values<T>().data();
        const T* in_b = b.values<T>().data();
        T* out = c.mutable_values<T>().data();
        const std::int64_t stride_a = a.shape(0) == 1 ? 0 : e.m * e.k;
        const std::int64_t stride_b = b.shape(0) == 1 ? 0 : e.n * e.k;
        if (options.transpose_a && !options.transpose_b && e.k >= 2 * inner_piece) {
            for (std::int64_t batch = 0; batch < e.batch; ++batch) {
                multiply_long_inner(in_a + batch * stride_a, in_b + batch * stride_b, out + batch * e.m * e.n, e, options);
            }
        } else {
            multiply_tiles(in_a, in_b, out, e, stride_a, stride_b, options);
        }
    });
    return c;
}

namespace {

template <class T>
void add_bias(T* tile, const T* bias, std::int64_t rows, std::int64_t channels) {
    for (std::int64_t row = 0; row < rows; ++row) {
        for (std::int64_t i = 0; i < channels; ++i) tile[row * channels + i] += bias[i];
    }
}

/// Applies the activation to `count` elements in place and writes its derivative to `slope` unless that is null.
template <class T>
void activate(T* values, T* slope, std::int64_t count, Activation activation) {
    if (activation == Activation::sine) {
        if (slope != nullptr) {
            for_each_sine_cosine(values, count, [=](std::int64_t i, T sine, T cosine) { values[i] = sine, slope[i] = cosine; });
        } else {
            for_each_sine_cosine(values, count, [=](std::int64_t i, T sine, T) { values[i] = sine; });
        }
    } else if (activation == Activation::leaky_relu) {
        constexpr T gain = static_cast<T>(std::numbers::sqrt2);
        for (std::int64_t i = 0; i < count; ++i) {
            const T factor = values[i] > T(0) ? gain : gain * static_cast<T>(0.2);
            values[i] *= factor;
            if (slope != nullptr) slope[i] = factor;
        }
    }
}

}  // namespace

LinearResult linear(const Tensor& x, const Tensor& weight, const Tensor& bias, Activation activation, bool with_slope) {
    const std::int64_t batch = x.shape(0);
    const std::int64_t rows = x.shape(1);
    const std::int64_t in_channels = x.shape(2);
    const std::int64_t out_channels = weight.shape(1);
    LinearResult result{Tensor({batch, rows, out_channels}, x.dtype()), {}};
    if (with_slope) result.slope = Tensor(result.value.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        const T* weights = weight.values<T>().data();
        const T* offsets = bias.defined() ? bias.values<T>().data() : nullptr;
        T* out = result.value.mutable_values<T>().data();
        T* slope = with_slope ? result.slope.mutable_values<T>().data() : nullptr;
        const std::int64_t tiles = chunk_count(rows, tile_rows);
        parallel_for(batch * tiles, 1, [&](std::int64_t index, std::int64_t) {
            const std::int64_t sample = index / tiles;
            const std::int64_t first = sample * rows + index % tiles * tile_rows;
            const std::int64_t count = std::min(tile_rows, (sample + 1) * rows - first);
            const T* sample_weights = weights + (weight.shape(0) == 1 ? 0 : sample * out_channels * in_channels);
            T* tile = out + first * out_channels;
            multiply_into(tile, in + first * in_channels, sample_weights, count, out_channels, in_channels, {.transpose_b = true},
                          false);
            if (offsets != nullptr) add_bias(tile, offsets, count, out_channels);
            activate(tile, slope == nullptr ? nullptr : slope + first * out_channels, count * out_channels, activation);
        });
    });
    return result;
}

}  // namespace stymo::kernels
