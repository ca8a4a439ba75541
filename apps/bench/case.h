#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/bench/table.h"
#include "apps/bench/timing.h"

namespace stymo {

/// Which of the machine's limits a row is compared with.
enum class Limit { none, float32, sixteen_bits };

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

/// One row of the table of speeds.
struct BenchCase {
    std::string name;
    std::string command;  ///< of stymo-bench, that measures it
    std::string what;     ///< in words
    Measurement (*measure)(const BenchRun& run);
    std::string peer{};  ///< what the peer calls it; empty: the peer has nothing like it
    int threads = 0;     ///< 0: as many as the command line says
};

/// All rows, in the order of the table.
[[nodiscard]] std::vector<BenchCase> bench_cases();
/// Throws UsageError for a name that no row has.
[[nodiscard]] BenchCase case_named(const std::string& name);

/// Columns of the table: first "name" and "what", then what `measure_case` gives, which leaves the
/// peer's columns empty.
[[nodiscard]] std::vector<Column> case_columns();
/// Measures a row in this process, then the peak that it is compared with.
[[nodiscard]] Row measure_case(const BenchCase& bench_case, const BenchRun& run);

// The rows of some commands each.
[[nodiscard]] std::vector<BenchCase> kernel_cases();
[[nodiscard]] std::vector<BenchCase> frame_cases();
[[nodiscard]] std::vector<BenchCase> step_cases();
[[nodiscard]] std::vector<BenchCase> training_cases();

}  // namespace stymo
