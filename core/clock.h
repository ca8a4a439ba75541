#pragma once

#include <chrono>
#include <ctime>

namespace stymo {

/// Seconds of a monotonic clock, for measuring durations.
[[nodiscard]] inline double seconds_now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

/// Processor time of the calling thread in seconds, to distinguish computing from waiting.
[[nodiscard]] inline double thread_seconds() {
    std::timespec time{};
    static_cast<void>(::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time));
    constexpr double nanosecond = 1e-9;
    return static_cast<double>(time.tv_sec) + nanosecond * static_cast<double>(time.tv_nsec);
}

}  // namespace stymo
