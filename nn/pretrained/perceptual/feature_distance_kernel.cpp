#include "nn/pretrained/perceptual/feature_distance_kernel.h"

#include <cmath>
#include <vector>

#include "core/parallel.h"

namespace stymo::kernels {

namespace {

constexpr std::int64_t pixels_at_once = 256;

template <class T>
T squared_norm(const T* x, std::int64_t channels) {
    T total = T(0);
#pragma omp simd reduction(+ : total)
    for (std::int64_t c = 0; c < channels; ++c) total += x[c] * x[c];
    return total;
}

/// 1 / (|x| + epsilon), where a norm of 0 is replaced by 1.
template <class T>
T inverse_norm(T squared, double epsilon) {
    return T(1) / ((squared == T(0) ? T(1) : std::sqrt(squared)) + static_cast<T>(epsilon));
}

}  // namespace

Tensor feature_distance(const Tensor& x, const Tensor& target, const Tensor& weight,
                        double epsilon) {
    const std::int64_t pixels = x.shape(1) * x.shape(2), channels = x.shape(3);
    Tensor result({x.shape(0)}, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* const weights = weight.values<T>().data();
        for (std::int64_t image = 0; image < x.shape(0); ++image) {
            const T* const in = x.values<T>().data() + image * pixels * channels;
            const T* const wanted = target.values<T>().data() + image * pixels * channels;
            std::vector<double> parts(
                static_cast<std::size_t>(chunk_count(pixels, pixels_at_once)));
            parallel_for(pixels, pixels_at_once, [&](std::int64_t begin, std::int64_t end) {
                double part = 0.0;
                for (std::int64_t at = begin * channels; at < end * channels; at += channels) {
                    const T factor = inverse_norm(squared_norm(in + at, channels), epsilon);
                    T total = T(0);
#pragma omp simd reduction(+ : total)
                    for (std::int64_t c = 0; c < channels; ++c) {
                        const T difference = in[at + c] * factor - wanted[at + c];
                        total += weights[c] * difference * difference;
                    }
                    part += static_cast<double>(total);
                }
                parts[static_cast<std::size_t>(begin / pixels_at_once)] = part;
            });
            double total = 0.0;
            for (const double part : parts) total += part;
            result.mutable_values<T>()[static_cast<std::size_t>(image)] =
                static_cast<T>(total / static_cast<double>(pixels));
        }
    });
    return result;
}

Tensor feature_distance_gradient(const Tensor& x, const Tensor& target, const Tensor& weight,
                                 double epsilon, const Tensor& dL_dy) {
    const std::int64_t pixels = x.shape(1) * x.shape(2), channels = x.shape(3);
    Tensor result(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* const in = x.values<T>().data();
        const T* const wanted = target.values<T>().data();
        const T* const weights = weight.values<T>().data();
        T* const out = result.mutable_values<T>().data();
        for (std::int64_t image = 0; image < x.shape(0); ++image) {
            const T scale =
                T(2) * dL_dy.values<T>()[static_cast<std::size_t>(image)] / static_cast<T>(pixels);
            parallel_for(pixels, pixels_at_once, [=](std::int64_t begin, std::int64_t end) {
                for (std::int64_t pixel = begin; pixel < end; ++pixel) {
                    const std::int64_t at = (image * pixels + pixel) * channels;
                    const T squared = squared_norm(in + at, channels);
                    const T factor = inverse_norm(squared, epsilon);
                    T along = T(0);
#pragma omp simd reduction(+ : along)
                    for (std::int64_t c = 0; c < channels; ++c) {
                        const T dL_dnormalised =
                            scale * weights[c] * (in[at + c] * factor - wanted[at + c]);
                        out[at + c] = dL_dnormalised;
                        along += dL_dnormalised * in[at + c];
                    }
                    // d factor / dx_c = -factor^2 x_c / |x|
                    const T back =
                        squared == T(0) ? T(0) : along * factor * factor / std::sqrt(squared);
#pragma omp simd
                    for (std::int64_t c = 0; c < channels; ++c)
                        out[at + c] = factor * out[at + c] - back * in[at + c];
                }
            });
        }
    });
    return result;
}

}  // namespace stymo::kernels
