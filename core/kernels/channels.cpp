#include "core/kernels/channels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

template <class T>
T inner_product(const T* a, const T* b, std::int64_t channels) {
    T total = T(0);
#pragma omp simd reduction(+ : total)
    for (std::int64_t c = 0; c < channels; ++c) total += a[c] * b[c];
    return total;
}

/// |x|, in float64 where the square leaves T's range of full precision; 1 for a vector of zeros,
/// which has no direction.
template <class T>
T norm_or_one(const T* x, std::int64_t channels) {
    const T squared_norm = inner_product(x, x, channels);
    if (squared_norm >= T(1e-30) && squared_norm <= T(1e30)) return std::sqrt(squared_norm);
    double total = 0.0;
    for (std::int64_t c = 0; c < channels; ++c)
        total += static_cast<double>(x[c]) * static_cast<double>(x[c]);
    return total == 0.0 ? T(1) : static_cast<T>(std::sqrt(total));
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
            const T norm = norm_or_one(in + offset, channels);
            const T factor = T(1) / (norm + static_cast<T>(epsilon));
            // 0 for a vector of zeros. The order of the products avoids intermediate overflow.
            const T along = inner_product(gradient + offset, in + offset, channels) * factor / norm;
#pragma omp simd
            for (std::int64_t c = 0; c < channels; ++c)
                out[offset + c] = factor * (gradient[offset + c] - along * in[offset + c]);
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
