#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "fit/evaluation.h"
#include "fit/fitter.h"
#include "train/dataset.h"

namespace stymo {

struct FaceRange {
    std::int64_t first = 0;
    std::int64_t last = -1;  ///< inclusive; -1: to the end
};

/// "700-799", "700-" or "5". Throws UsageError for anything else.
[[nodiscard]] FaceRange parse_range(const std::string& text);

struct FaceScore {
    std::string id;
    ImageMetrics initial;
    ImageMetrics fitted;            ///< equal to `initial` without fitting
    double counting_samples = 1.0;  ///< View::counting_samples of the fitted face
};

struct EvaluationOptions {
    FaceRange range;
    bool fit = false;
    FitOptions fitting;
    std::int64_t resolution = 0;   ///< of the pictures that are compared; 0: the model's own
    const Lpips* lpips = nullptr;  ///< also measures LPIPS with it
    std::int64_t batch = 4;        ///< faces fitted at once
    std::int64_t yaw_rows = 0;     ///< faces of the turning sheet
};

struct Evaluation {
    std::vector<FaceScore> scores;
    Tensor turning_sheet;      ///< target | fitted | yaw -30, -15, 0, 15, 30 degrees; undefined unless asked for
    std::string incomplete{};  ///< after an interruption how far it came, else empty
};

/// Scores faces in order of id against the model; `loss` is what fitting minimises. A face whose picture is broken is left out.
/// After an interruption the scores so far, without those of faces whose fit was cut short. Throws FileError if there is none.
[[nodiscard]] Evaluation evaluate(const Model& model, const ReconstructionLoss& loss, const Dataset& faces,
                                  const EvaluationOptions& options);
[[nodiscard]] std::string table(const std::vector<FaceScore>& scores, bool fitted);
[[nodiscard]] JsonValue to_json(const std::vector<FaceScore>& scores, bool fitted);

}  // namespace stymo
