#pragma once

#include <algorithm>
#include <cmath>

namespace stymo {

/// log(1 + exp(x)) for one number.
[[nodiscard]] inline float softplus(float x) {
    return std::max(x, 0.0F) + std::log1p(std::exp(-std::abs(x)));
}

/// The inverse, which takes what is too thin to tell from nothing for exp(-60).
[[nodiscard]] inline float inverse_softplus(float density) {
    constexpr float least_input = -60.0F;
    // Beyond, exp overflows, and the softplus is its own argument to float32's precision.
    constexpr float linear_from = 20.0F;
    return density > linear_from ? density : std::max(std::log(std::expm1(density)), least_input);
}

}  // namespace stymo
