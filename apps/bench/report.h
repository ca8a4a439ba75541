#pragma once

#include <filesystem>
#include <string>

#include "apps/bench/subject.h"
#include "apps/common/command_line.h"
#include "apps/common/tool_options.h"

namespace stymo {

struct ReportOptions {
    BenchOptions bench;
    std::filesystem::path fit_model{};  ///< model of the study of fitting; empty: that of `bench`
    std::filesystem::path fit_data{};
    LpipsOptions lpips{};
    std::filesystem::path out;
    std::string parts{};  ///< names of studies, separated by commas; empty: all studies whose
                          ///< inputs are available
};

/// Writes report.md with its plots and tables. The folder is created when all studies are done.
/// Throws UsageError for an unknown study, and for a study that needs a model if only one of
/// --model and --data was given.
[[nodiscard]] AppResult write_report(const ReportOptions& options, const CommonOptions& common);
/// The names of all studies: "quadrature,rendering,...".
[[nodiscard]] std::string report_study_names();

}  // namespace stymo
