#pragma once

#include <functional>
#include <vector>

namespace stymo {

/// Seconds that something took, time after time.
struct Timing {
    std::vector<double> seconds;

    [[nodiscard]] double median() const;
    [[nodiscard]] double minimum() const;
};

/// Calls `body` once unmeasured, then at least `repeats` times and for `at_least_seconds`, but at most a hundred times.
[[nodiscard]] Timing time_repeated(int repeats, double at_least_seconds, const std::function<void()>& body);

/// The largest memory that this process has had in RAM so far, in MiB; 0 where the system does not say.
[[nodiscard]] double peak_memory_mebibytes();

}  // namespace stymo
