#pragma once

#include <string>
#include <utility>
#include <vector>

#include "apps/eval/evaluate.h"
#include "apps/eval/score_sheet.h"

namespace stymo {

/// The settings on which the scores depend, by the names of the options.
using Settings = std::vector<std::pair<std::string, JsonValue>>;

/// The contents of report.md besides the scores.
struct ReportContext {
    Settings settings;
    std::string lpips_network;   ///< empty: LPIPS was not measured
    std::vector<SheetRow> rows;  ///< rows of sheet.png
};

/// A Markdown page: the table of means and medians, the failures, the settings, and the sheet with
/// a legend of its rows.
[[nodiscard]] std::string report_page(const Evaluation& evaluation, const ReportContext& context);

}  // namespace stymo
