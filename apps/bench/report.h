#pragma once

#include "apps/bench/speed.h"

/// The commands of stymo-bench that run studies.
namespace stymo {

struct ReportOptions {
    BenchOptions bench;
    std::filesystem::path out{};  ///< empty: nothing is written
    PeerProgram peer{};           ///< of the commands with rows
    // Of the report:
    std::filesystem::path fit_model{};  ///< model of the study of fitting; empty: that of `bench`
    std::filesystem::path fit_data{};
    LpipsOptions lpips{};
    std::string parts{};  ///< separated by commas; empty: all parts whose inputs are available
};

/// Runs the studies of a command: its rows of the table of speeds, the curve, growth or the bias.
/// Files in `out` are named after the command.
[[nodiscard]] AppResult bench_session(const std::string& command, const ReportOptions& options);
/// Writes report.md with its tables. The folder is created when all studies are done. Throws
/// UsageError for an unknown part, and for a part that needs a model if only one of --model and
/// --data was given.
[[nodiscard]] AppResult write_report(const ReportOptions& options);
/// The names of all parts: "quadrature,rendering,...".
[[nodiscard]] std::string report_parts();

}  // namespace stymo
