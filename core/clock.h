#pragma once

#include <chrono>

namespace stymo {

/// Seconds on a clock that only runs forward, to take differences of.
[[nodiscard]] inline double seconds_now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace stymo
