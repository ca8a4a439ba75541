#pragma once

#include <functional>
#include <vector>

namespace stymo {

/// Seconds that something took, time after time.
struct Timing {
    std::vector<double> seconds;
    std::vector<double> multiply_adds{};  ///< float32 operations per second that the machine gave
                                          ///< in between, with registers alone

    /// Takes a run, and measures what the machine gives now.
    void add(double run_seconds);
    void add(const Timing& other);
    [[nodiscard]] double median() const;
    [[nodiscard]] double minimum() const;
    [[nodiscard]] double median_multiply_adds() const;  ///< 0 if it was not measured
};

/// Calls `body` once unmeasured, then at least `repeats` times and for `at_least_seconds`, but at
/// most a hundred times.
[[nodiscard]] Timing time_repeated(int repeats, double at_least_seconds,
                                   const std::function<void()>& body);

/// The largest memory that this process has had in RAM so far, in MiB; 0 where the system does not
/// say.
[[nodiscard]] double peak_memory_mebibytes();

}  // namespace stymo
