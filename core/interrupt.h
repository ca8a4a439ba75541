#pragma once

#include <array>
#include <csignal>

namespace stymo {

/// While it lives, SIGINT and SIGTERM do not end the process but make `interrupted()` true, so that a long loop can save
/// what it has and return. A second signal of the same kind ends the process at once. The former handlers come back with
/// the destructor.
///
/// A signal handler can reach nothing but a global: the flag behind `interrupted()` is unavoidable.
class InterruptGuard {
public:
    /// Forgets an earlier interruption.
    InterruptGuard();
    ~InterruptGuard();
    InterruptGuard(const InterruptGuard&) = delete;
    InterruptGuard& operator=(const InterruptGuard&) = delete;

private:
    static constexpr std::array signals_ = {SIGINT, SIGTERM};
    std::array<struct sigaction, signals_.size()> former_{};
};

/// Whether a signal came since the last guard was made. To be polled between steps.
[[nodiscard]] bool interrupted();

}  // namespace stymo
