#pragma once

#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/eval/evaluate.h"
#include "apps/eval/score_sheet.h"

namespace stymo {

/// The contents of report.md besides the scores.
struct ReportContext {
    Settings settings;           ///< on which the scores depend
    std::string lpips_network;   ///< empty: LPIPS was not measured
    std::vector<SheetRow> rows;  ///< rows of sheet.png
};

/// A Markdown page: the table of means and medians, the failures, the settings, and the sheet with
/// a legend of its rows.
[[nodiscard]] std::string report_page(const Evaluation& evaluation, const ReportContext& context);

}  // namespace stymo
