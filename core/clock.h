#pragma once

#include <chrono>

namespace stymo {

/// Seconds of a monotonic clock, for measuring durations.
[[nodiscard]] inline double seconds_now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

}  // namespace stymo
