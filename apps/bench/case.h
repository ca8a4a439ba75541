#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/bench/table.h"
#include "apps/bench/timing.h"

namespace stymo {

/// The peak performance with which a row is compared.
enum class Limit { none, float32, sixteen_bits };

struct Measurement {
    Timing timing;      ///< of one frame, step, ...
    double work = 0.0;  ///< multiply-adds done in that time; 0: not counted
    Limit limit = Limit::float32;
    std::optional<double> psnr_mean{};  ///< decibels against the exact frame, mean over all views
    std::optional<double> psnr_worst{};
    double peak_memory = 0.0;  ///< MiB, of a process that does nothing else
    std::string remark{};
};

/// The inputs of a measurement.
struct BenchRun {
    const BenchOptions& options;
    std::uint64_t seed = 0;
};

/// One row of the table of speeds.
struct BenchCase {
    std::string name;
    std::string command;  ///< command of stymo-bench that measures it
    std::string what;     ///< description
    Measurement (*measure)(const BenchRun& run);
    std::string peer{};  ///< name of the peer's measurement; empty: the peer has none
    int threads = 0;     ///< 0: the number of the command line
};

/// All rows, in the order of the table.
[[nodiscard]] std::vector<BenchCase> bench_cases();
/// The row with this name. Throws UsageError for an unknown name.
[[nodiscard]] BenchCase case_named(const std::string& name);

/// Columns of the table: first "name" and "what", then those of `measure_case`, which leaves the
/// peer's columns empty.
[[nodiscard]] std::vector<Column> case_columns();
/// Measures a row in this process, then the peak performance with which it is compared.
[[nodiscard]] Row measure_case(const BenchCase& bench_case, const BenchRun& run);

// The rows of bench_cases, by topic.
[[nodiscard]] std::vector<BenchCase> kernel_cases();
[[nodiscard]] std::vector<BenchCase> frame_cases();
[[nodiscard]] std::vector<BenchCase> step_cases();
[[nodiscard]] std::vector<BenchCase> training_cases();

}  // namespace stymo
