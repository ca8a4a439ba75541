#pragma once

#include <string>
#include <utility>
#include <vector>

#include "apps/eval/evaluate.h"
#include "apps/eval/score_sheet.h"

namespace stymo {

/// What the scores depend on, by the names of the options.
using Settings = std::vector<std::pair<std::string, JsonValue>>;

/// What an evaluation's report.md says beside its scores.
struct ReportContext {
    Settings settings;
    std::string lpips_network;   ///< empty: LPIPS was not measured
    std::vector<SheetRow> rows;  ///< of sheet.png
};

/// A page in Markdown: the table of means and medians, what failed, the settings, and the sheet with what its rows are.
[[nodiscard]] std::string report_page(const Evaluation& evaluation, const ReportContext& context);

}  // namespace stymo
