#pragma once

#include <functional>
#include <vector>

namespace stymo {

/// Times of repeated runs.
struct Timing {
    std::vector<double> seconds;
    std::vector<double> multiply_adds{};  ///< float32 operations per second of the machine after
                                          ///< each run (measure_multiply_adds)

    /// Adds a run, and measures the current performance of the machine.
    void add(double run_seconds);
    void add(const Timing& other);
    [[nodiscard]] double median() const;
    [[nodiscard]] double minimum() const;
    [[nodiscard]] double median_multiply_adds() const;  ///< 0 if it was not measured
};

/// Calls `body` once without timing, then at least `repeats` times and for at least
/// `at_least_seconds`, but at most a hundred times.
[[nodiscard]] Timing time_repeated(int repeats, double at_least_seconds,
                                   const std::function<void()>& body);

/// Peak resident memory of this process in MiB; 0 if the system does not report it.
[[nodiscard]] double peak_memory_mebibytes();

}  // namespace stymo
