#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "render/composite.h"

/// Volume rendering of one ray, from front to back (paper, equations (3) to (5)).
namespace stymo {

/// log(1 + exp(x)) for one number.
template <class T>
[[nodiscard]] inline T softplus_of(T x) {
    return std::max(x, T(0)) + std::log1p(std::exp(-std::abs(x)));
}
[[nodiscard]] inline float softplus(float x) {
    return softplus_of(x);
}

/// The inverse of softplus for densities >= 0. Densities below exp(-60) count as exp(-60).
[[nodiscard]] inline float inverse_softplus(float density) {
    constexpr float least_input = -60.0F;
    // Above this, softplus(x) = x to float32's precision. expm1 overflows for large densities.
    constexpr float linear_from = 20.0F;
    return density > linear_from ? density : std::max(std::log(std::expm1(density)), least_input);
}

template <class T>
[[nodiscard]] T density_of_logit(T logit) {
    return std::min(softplus_of(logit), static_cast<T>(largest_density));
}

/// Transmittance along a ray, from front to back.
template <class T>
class Transmittance {
public:
    /// Passes an interval of this optical thickness and returns its compositing weight.
    [[nodiscard]] T pass(T thickness) {
        depth_ += static_cast<double>(thickness);
        // Subtracting the two transmittances would lose precision where the density is low.
        const T weight = value_ * -std::expm1(-thickness);
        value_ = std::exp(static_cast<T>(-depth_));
        return weight;
    }
    [[nodiscard]] T value() const { return value_; }

private:
    double depth_ = 0.0;
    T value_ = T(1);
};

/// sum += weight * features
template <class T>
void add_weighted(T* sum, T weight, const T* features, std::int64_t width) {
#pragma omp simd
    for (std::int64_t i = 0; i < width; ++i) sum[i] += weight * features[i];
}

}  // namespace stymo
