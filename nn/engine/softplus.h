#pragma once

#include <algorithm>
#include <cmath>

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

}  // namespace stymo
