#pragma once

#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/eval/evaluate.h"

namespace stymo {

/// A row of the sheet.
struct SheetRow {
    std::string kind;  ///< "best", "median", "worst"
    std::string id;
    double psnr = 0.0;  ///< of the first region and the last stage
};

/// Chooses three faces of each kind by PSNR, best first; one of each kind if there are fewer than
/// nine faces; all faces if there are fewer than three.
[[nodiscard]] std::vector<SheetRow> sheet_rows(const std::vector<FaceScore>& scores);

/// An image with these rows: target | initial | fitted | tuned if there is one | yaw -30 | yaw 30
/// degrees | error. The error is 4 |last stage - target| within the first region, mean over RGB.
/// Fitted codes and tuned weights are read from the folder; without fitting the initial codes are
/// shown.
[[nodiscard]] Tensor score_sheet(const FitJob& job, const Dataset& faces,
                                 const EvaluationOptions& options,
                                 const std::vector<SheetRow>& rows);

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
