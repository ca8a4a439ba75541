#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/bench/timing.h"

namespace stymo {

/// Which of the machine's limits a row is held against.
enum class Limit { none, float32, sixteen_bits };

/// What was found out about one row.
struct Measurement {
    Timing timing;      ///< of one frame, step, ...
    double work = 0.0;  ///< multiply-adds done in that time; 0: not counted
    Limit limit = Limit::float32;
    std::optional<double> psnr_mean{};  ///< dB against the exact frame, over all views
    std::optional<double> psnr_worst{};
    double peak_memory = 0.0;  ///< MiB, of a process that did nothing else
    std::string remark{};
};

/// What a measurement starts from.
struct BenchRun {
    const BenchOptions& options;
    std::uint64_t seed = 0;
};

/// One row of the table.
struct BenchCase {
    std::string name;
    std::string command;  ///< of stymo-bench, that measures it
    std::string what;     ///< in words
    std::string peer{};   ///< what the peer calls it; empty: the peer has nothing like it
    int threads = 0;      ///< 0: as many as the command line says
    Measurement (*measure)(const BenchRun& run);
};

/// Every row there is, in the order of the table.
[[nodiscard]] std::vector<BenchCase> bench_cases();
/// Throws UsageError for a name that no row has.
[[nodiscard]] BenchCase case_named(const std::string& name);

// The rows of one command each.
[[nodiscard]] std::vector<BenchCase> kernel_cases();
[[nodiscard]] std::vector<BenchCase> frame_cases();
[[nodiscard]] std::vector<BenchCase> step_cases();

}  // namespace stymo
