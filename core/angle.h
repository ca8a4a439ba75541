#pragma once

#include <numbers>

namespace stymo {

[[nodiscard]] constexpr double radians_from_degrees(double degrees) {
    return degrees * std::numbers::pi / 180.0;
}
[[nodiscard]] constexpr double degrees_from_radians(double radians) {
    return radians * 180.0 / std::numbers::pi;
}

}  // namespace stymo
