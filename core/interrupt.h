#pragma once

#include <array>
#include <csignal>

namespace stymo {

/// During its lifetime SIGINT and SIGTERM do not end the process but make `interrupted()` true, so
/// that a long loop can save its state and return. A second signal of the same kind ends the
/// process at once. The destructor restores the former handlers.
///
/// The flag behind `interrupted()` is global because a signal handler can reach nothing else.
class InterruptGuard {
public:
    /// Resets `interrupted()` to false, unless another guard lives.
    InterruptGuard();
    ~InterruptGuard();
    InterruptGuard(const InterruptGuard&) = delete;
    InterruptGuard& operator=(const InterruptGuard&) = delete;

private:
    static constexpr std::array signals_ = {SIGINT, SIGTERM};
    std::array<struct sigaction, signals_.size()> former_{};
};

/// Whether a signal arrived since the outermost guard was constructed. Long loops poll it between
/// steps.
[[nodiscard]] bool interrupted();

}  // namespace stymo
