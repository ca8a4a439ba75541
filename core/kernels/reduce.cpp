#include "core/kernels/reduce.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

/// A tensor seen as (outer, middle, inner), the middle being what a loop runs along.
struct Blocks {
    std::int64_t outer;
    std::int64_t middle;
    std::int64_t inner;
};

/// Sum of a contiguous run with independent lanes, so that it vectorises without changing with the
/// thread count.
template <class T>
T sum_run(const T* x, std::int64_t count) {
    constexpr std::int64_t lanes = 32;
    // Short enough that the rounding errors of a lane stay below 1e-6 even if all are of one sign.
    constexpr std::int64_t block = 16 * lanes;
    std::array<double, lanes> totals{};
    std::int64_t i = 0;
    while (i + lanes <= count) {
        const std::int64_t end = std::min(i + block, count);
        std::array<T, lanes> partial{};
        for (; i + lanes <= end; i += lanes) {
            for (std::int64_t lane = 0; lane < lanes; ++lane)
                partial[static_cast<std::size_t>(lane)] += x[i + lane];
        }
        for (std::size_t lane = 0; lane < totals.size(); ++lane)
            totals[lane] += static_cast<double>(partial[lane]);
    }
    double total = std::accumulate(totals.begin(), totals.end(), 0.0);
    for (; i < count; ++i) total += static_cast<double>(x[i]);
    return static_cast<T>(total);
}

template <class T>
void sum_contiguous(const T* x, T* y, const Blocks& blocks) {
    constexpr std::int64_t chunk = 65536;
    const std::int64_t pieces = chunk_count(blocks.middle, chunk);
    if (pieces <= 1) {
        const std::int64_t grain =
            std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, blocks.middle));
        parallel_for(blocks.outer, grain, [=](std::int64_t begin, std::int64_t end) {
            for (std::int64_t row = begin; row < end; ++row)
                y[row] = sum_run(x + row * blocks.middle, blocks.middle);
        });
        return;
    }
    std::vector<T> partial(static_cast<std::size_t>(blocks.outer * pieces));
    parallel_for(blocks.outer * pieces, 1, [&](std::int64_t begin, std::int64_t) {
        const std::int64_t first = begin % pieces * chunk;
        partial[static_cast<std::size_t>(begin)] = sum_run(
            x + begin / pieces * blocks.middle + first, std::min(chunk, blocks.middle - first));
    });
    for (std::int64_t row = 0; row < blocks.outer; ++row)
        y[row] = sum_run(partial.data() + row * pieces, pieces);
}

/// Adds rows [begin, end) of one block onto `y`.
template <class T>
void add_rows(const T* x, T* y, std::int64_t begin, std::int64_t end, std::int64_t inner) {
    std::fill_n(y, inner, T(0));
    for (std::int64_t row = begin; row < end; ++row) {
        const T* from = x + row * inner;
        for (std::int64_t i = 0; i < inner; ++i) y[i] += from[i];
    }
}

template <class T>
void sum_strided(const T* x, T* y, const Blocks& blocks) {
    constexpr std::int64_t chunk = 1024;
    const std::int64_t pieces = std::max<std::int64_t>(1, chunk_count(blocks.middle, chunk));
    std::vector<T> partial(static_cast<std::size_t>(blocks.outer * pieces * blocks.inner));
    const std::int64_t grain = std::max<std::int64_t>(
        1, elementwise_grain /
               std::max<std::int64_t>(1, std::min(chunk, blocks.middle) * blocks.inner));
    parallel_for(blocks.outer * pieces, grain, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t piece = begin; piece < end; ++piece) {
            const std::int64_t first = piece % pieces * chunk;
            add_rows(x + piece / pieces * blocks.middle * blocks.inner,
                     partial.data() + piece * blocks.inner, first,
                     std::min(blocks.middle, first + chunk), blocks.inner);
        }
    });
    for (std::int64_t row = 0; row < blocks.outer; ++row)
        add_rows(partial.data() + row * pieces * blocks.inner, y + row * blocks.inner, 0, pieces,
                 blocks.inner);
}

Tensor sum_axes(const Tensor& x, int first, int last) {
    const Blocks blocks{x.shape().product(0, first), x.shape().product(first, last),
                        x.shape().product(last, x.rank())};
    Shape shape = x.shape();
    for (int axis = first; axis < last; ++axis) shape = shape.with(axis, 1);
    Tensor y(shape, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        if (blocks.inner == 1) {
            sum_contiguous(in, out, blocks);
        } else {
            sum_strided(in, out, blocks);
        }
    });
    return y;
}

Blocks blocks_along(const Shape& shape, int axis) {
    return {shape.product(0, axis), shape[axis], shape.product(axis + 1, shape.rank())};
}

}  // namespace

Tensor sum(const Tensor& x, std::uint32_t reduced) {
    Tensor result = x;
    for (int last = x.rank(); last > 0; --last) {
        if (((reduced >> (last - 1)) & 1U) == 0) continue;
        int first = last - 1;
        while (first > 0 && ((reduced >> (first - 1)) & 1U) != 0) --first;
        result = sum_axes(result, first, last);
        last = first + 1;
    }
    return result;
}

Tensor cumsum(const Tensor& x, int axis, bool exclusive) {
    const Blocks blocks = blocks_along(x.shape(), axis);
    Tensor y(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const std::int64_t grain =
            std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, blocks.middle));
        parallel_for(blocks.outer * blocks.inner, grain, [=](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                const std::int64_t start =
                    i / blocks.inner * blocks.middle * blocks.inner + i % blocks.inner;
                double running = 0.0;
                for (std::int64_t j = 0; j < blocks.middle; ++j) {
                    const std::int64_t index = start + j * blocks.inner;
                    const double next = running + static_cast<double>(in[index]);
                    out[index] = static_cast<T>(exclusive ? running : next);
                    running = next;
                }
            }
        });
    });
    return y;
}

namespace {

template <class T>
T inner_product(const T* a, const T* b, std::int64_t channels) {
    T total = T(0);
#pragma omp simd reduction(+ : total)
    for (std::int64_t c = 0; c < channels; ++c) total += a[c] * b[c];
    return total;
}

/// 1 for a vector of zeros.
template <class T>
double norm_in_float64(const T* x, std::int64_t channels) {
    double total = 0.0;
    for (std::int64_t c = 0; c < channels; ++c)
        total += static_cast<double>(x[c]) * static_cast<double>(x[c]);
    return total == 0.0 ? 1.0 : std::sqrt(total);
}

/// |x|, in float64 where the square leaves T's range of full precision; 1 for a vector of zeros,
/// which has no direction.
template <class T>
T norm_or_one(const T* x, std::int64_t channels) {
    const T squared_norm = inner_product(x, x, channels);
    if (squared_norm >= T(1e-30) && squared_norm <= T(1e30)) return std::sqrt(squared_norm);
    return static_cast<T>(norm_in_float64(x, channels));
}

/// Calls body(offset of the first channel) for every pixel, on several threads.
template <class Body>
void for_each_pixel(const Tensor& x, Body body) {
    const std::int64_t channels = std::max<std::int64_t>(1, x.shape(-1));
    parallel_for(x.size() / channels, std::max<std::int64_t>(1, elementwise_grain / channels),
                 [&](std::int64_t begin, std::int64_t end) {
                     for (std::int64_t pixel = begin; pixel < end; ++pixel) body(pixel * channels);
                 });
}

}  // namespace

Tensor unit_channels(const Tensor& x, double epsilon) {
    Tensor y(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const std::int64_t channels = x.shape(-1);
        for_each_pixel(x, [=](std::int64_t offset) {
            const T factor = T(1) / (norm_or_one(in + offset, channels) + static_cast<T>(epsilon));
#pragma omp simd
            for (std::int64_t c = 0; c < channels; ++c) out[offset + c] = factor * in[offset + c];
        });
    });
    return y;
}

Tensor unit_channels_gradient(const Tensor& dL_dy, const Tensor& x, double epsilon) {
    Tensor dL_dx(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* gradient = dL_dy.values<T>().data();
        const T* in = x.values<T>().data();
        T* out = dL_dx.mutable_values<T>().data();
        const std::int64_t channels = x.shape(-1);
        for_each_pixel(x, [=](std::int64_t offset) {
            const auto set_pixel = [&]<class A>(A norm) {
                const A factor = A(1) / (norm + static_cast<A>(epsilon));
                A along = A(0);  // stays 0 for a vector of zeros
#pragma omp simd reduction(+ : along)
                for (std::int64_t c = 0; c < channels; ++c)
                    along += static_cast<A>(gradient[offset + c]) * static_cast<A>(in[offset + c]);
                // The order of the products avoids intermediate overflow.
                along = along * factor / norm;
#pragma omp simd
                for (std::int64_t c = 0; c < channels; ++c)
                    out[offset + c] =
                        static_cast<T>(factor * (static_cast<A>(gradient[offset + c]) -
                                                 along * static_cast<A>(in[offset + c])));
            };
            const T norm = norm_or_one(in + offset, channels);
            if (norm >= T(1e-15) && norm <= T(1e15))
                set_pixel(norm);
            else
                set_pixel(norm_in_float64(in + offset, channels));
        });
    });
    return dL_dx;
}

Tensor mean_squared_difference(const Tensor& a, const Tensor& b) {
    const std::int64_t channels = a.shape(3);
    const std::int64_t pixels = a.shape(1) * a.shape(2);
    Tensor mean({a.shape(0), 1, 1, channels}, a.dtype());
    dispatch(a.dtype(), [&]<class T>(T) {
        const T* left = a.values<T>().data();
        const T* right = b.values<T>().data();
        // Runs of pixels, each with its own sums. Their number depends only on the shape.
        const std::int64_t run =
            std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, channels));
        const std::int64_t runs = chunk_count(pixels, run);
        std::vector<T> sums(static_cast<std::size_t>(a.shape(0) * runs * channels), T(0));
        parallel_for(a.shape(0) * runs, 1, [&](std::int64_t index, std::int64_t) {
            const std::int64_t first = index % runs * run;
            const std::int64_t last = std::min(pixels, first + run);
            T* const sum = sums.data() + index * channels;
            for (std::int64_t pixel = index / runs * pixels + first;
                 pixel < index / runs * pixels + last; ++pixel) {
                const T* p = left + pixel * channels;
                const T* q = right + pixel * channels;
#pragma omp simd
                for (std::int64_t c = 0; c < channels; ++c) sum[c] += (p[c] - q[c]) * (p[c] - q[c]);
            }
        });
        const auto out = mean.mutable_values<T>();
        for (std::int64_t i = 0; i < a.shape(0) * channels; ++i) {
            double total = 0.0;
            for (std::int64_t part = 0; part < runs; ++part)
                total += static_cast<double>(sums[static_cast<std::size_t>(
                    (i / channels * runs + part) * channels + i % channels)]);
            out[static_cast<std::size_t>(i)] = static_cast<T>(total / static_cast<double>(pixels));
        }
    });
    return mean;
}

}  // namespace stymo::kernels
