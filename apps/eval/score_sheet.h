#pragma once

#include <string>
#include <vector>

#include "apps/eval/evaluate.h"

namespace stymo {

/// Faces for the sheet.
struct SheetRow {
    std::string kind;  ///< "best", "median", "worst"
    std::string id;
    double psnr = 0.0;  ///< of the first region, of the last stage
};

/// Three rows of each kind by that PSNR, best first, one of each if there are fewer than nine
/// faces; all faces if fewer than three.
[[nodiscard]] std::vector<SheetRow> sheet_rows(const std::vector<FaceScore>& scores);

/// A row for each: target | initial | fitted | tuned if there is one | yaw -30 | yaw 30 degrees |
/// error: |last face - target| within the first region, mean over RGB, times 4. Fitted codes and
/// tuned weights come from the folder; without fitting the encoder's codes stand in for them.
[[nodiscard]] Tensor score_sheet(const Model& model, const ReconstructionLoss& loss,
                                 const Dataset& faces, const EvaluationOptions& options,
                                 const std::vector<SheetRow>& rows);

}  // namespace stymo
