#pragma once

#include <filesystem>
#include <string>

#include "apps/bench/subject.h"
#include "apps/common/command_line.h"
#include "apps/common/lpips_options.h"

namespace stymo {

struct ReportOptions {
    BenchOptions bench;
    std::filesystem::path fit_model{};  ///< of the study of fitting; empty: the same
    std::filesystem::path fit_data{};
    LpipsOptions lpips{};
    std::filesystem::path out;
    std::string parts{};  ///< names of studies, separated by commas; empty: all that the inputs
                          ///< are there for
};

/// Writes report.md with its plots and tables; the folder appears when all of it is done. Throws
/// UsageError for a study that does not exist, and for one that needs a model if --model or --data
/// was given without the other.
[[nodiscard]] AppResult write_report(const ReportOptions& options, const CommonOptions& common);
/// "quadrature,rendering,...": all there are.
[[nodiscard]] std::string report_study_names();

}  // namespace stymo
