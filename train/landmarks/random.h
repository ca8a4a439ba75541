#pragma once

#include "core/rng.h"

namespace stymo {

/// Uniform in [low, high).
[[nodiscard]] inline double between(Rng& rng, double low, double high) {
    return low + (high - low) * rng.uniform();
}

/// True with this probability.
[[nodiscard]] inline bool chance(Rng& rng, double probability) {
    return rng.uniform() < probability;
}

/// A normal number with mean 0, truncated to [-limit, limit] by drawing again.
[[nodiscard]] inline double limited_normal(Rng& rng, double deviation, double limit) {
    double value = deviation * rng.normal();
    while (value > limit || value < -limit) value = deviation * rng.normal();
    return value;
}

/// Smooth step from 0 at `low` to 1 at `high`, constant outside; `low` may be greater than `high`.
[[nodiscard]] inline double ramp(double low, double high, double x) {
    double t = (x - low) / (high - low);
    t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
    return t * t * (3.0 - 2.0 * t);
}

}  // namespace stymo
