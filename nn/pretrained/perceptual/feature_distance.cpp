#include "nn/pretrained/perceptual/feature_distance.h"

#include <algorithm>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"
#include "core/parallel.h"

namespace stymo {

namespace {

constexpr std::int64_t pixels_at_once = 256;

/// In A.
template <class A, class T>
A squared_norm(const T* x, std::int64_t channels) {
    A total = A(0);
#pragma omp simd reduction(+ : total)
    for (std::int64_t c = 0; c < channels; ++c)
        total += static_cast<A>(x[c]) * static_cast<A>(x[c]);
    return total;
}

/// 1 / (|x| + epsilon), where a norm of 0 is replaced by 1.
template <class A>
A inverse_norm(A squared, double epsilon) {
    return A(1) / ((squared == A(0) ? A(1) : std::sqrt(squared)) + static_cast<A>(epsilon));
}

/// Calls body(|x|^2), in float64 where the square leaves T's range of full precision. The pixel is
/// computed in the same type.
template <class T, class Body>
auto with_squared_norm(const T* x, std::int64_t channels, Body body) {
    const T squared = squared_norm<T>(x, channels);
    if ((squared >= T(1e-30) && squared <= T(1e30)) ||
        std::all_of(x, x + channels, [](T value) { return value == T(0); }))
        return body(squared);
    return body(squared_norm<double>(x, channels));
}

/// sum_c weight_c (x_c / |x| - target_c)^2, computed in A.
template <class A, class T>
A pixel_distance(const T* x, A squared, const T* target, const T* weights, std::int64_t channels,
                 double epsilon) {
    const A factor = inverse_norm(squared, epsilon);
    A total = A(0);
#pragma omp simd reduction(+ : total)
    for (std::int64_t c = 0; c < channels; ++c) {
        const A difference = x[c] * factor - target[c];
        total += weights[c] * difference * difference;
    }
    return total;
}

/// The gradient of `scale` times that.
template <class A, class T>
void pixel_gradient(const T* x, A squared, const T* target, const T* weights, std::int64_t channels,
                    double epsilon, T scale, T* out) {
    const A factor = inverse_norm(squared, epsilon);
    A along = A(0);
#pragma omp simd reduction(+ : along)
    for (std::int64_t c = 0; c < channels; ++c) {
        const A dL_dnormalised = static_cast<A>(scale) * weights[c] * (x[c] * factor - target[c]);
        along += dL_dnormalised * x[c];
        out[c] = static_cast<T>(dL_dnormalised);
    }
    // d factor / dx_c = -factor^2 x_c / |x|
    const A back = squared == A(0) ? A(0) : along * factor * factor / std::sqrt(squared);
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c)
        out[c] = static_cast<T>(factor * out[c] - back * x[c]);
}

Tensor distance_of(const Tensor& x, const Tensor& target, const Tensor& weight, double epsilon) {
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
                    part += with_squared_norm(in + at, channels, [&](auto squared) {
                        return static_cast<double>(pixel_distance(in + at, squared, wanted + at,
                                                                  weights, channels, epsilon));
                    });
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

/// dL/dx for dL_dy (B).
Tensor gradient_of(const Tensor& x, const Tensor& target, const Tensor& weight, double epsilon,
                   const Tensor& dL_dy) {
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
                    with_squared_norm(in + at, channels, [&](auto squared) {
                        pixel_gradient(in + at, squared, wanted + at, weights, channels, epsilon,
                                       scale, out + at);
                    });
                }
            });
        }
    });
    return result;
}

void check(const Variable& x, const Tensor& target, const Tensor& weight) {
    if (x.rank() != 4 || x.shape() != target.shape() || weight.shape() != Shape{x.shape(3)}) {
        fail<ShapeError>("[feature_distance] x ", x.shape(), ", target ", target.shape(),
                         " and weight ", weight.shape(), " are not (B, h, w, C) twice and (C)");
    }
}

}  // namespace

Variable feature_distance_reference(const Variable& x, const Tensor& target, const Tensor& weight) {
    check(x, target, weight);
    return reshape(
        sum(mean_squared_difference(unit_channels(x, feature_epsilon), target) * Variable(weight),
            {3}),
        {-1});
}

Variable feature_distance(const Variable& x, const Tensor& target, const Tensor& weight) {
    check(x, target, weight);
    return record("feature_distance", distance_of(x.value(), target, weight, feature_epsilon), {x},
                  Save::input(0), {[target, weight](const Vjp& v) {
                      const Variable x_in = v.input(0);
                      if (!v.create_graph())
                          return Variable(gradient_of(x_in.value(), target, weight, feature_epsilon,
                                                      v.grad().value()));
                      return grad(feature_distance_reference(x_in, target, weight), x_in,
                                  {.create_graph = true, .partial = true, .dL_dy = v.grad()});
                  }});
}

}  // namespace stymo
