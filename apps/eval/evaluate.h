#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/eval/face_region.h"
#include "apps/eval/score.h"
#include "apps/eval/score_folder.h"
#include "fit/fit_report.h"
#include "train/dataset.h"

namespace stymo {

struct FaceRange {
    std::int64_t first = 0;
    std::int64_t last = -1;  ///< inclusive; -1: to the end
};

/// "700-799", "700-" or "5". Throws UsageError for anything else.
[[nodiscard]] FaceRange parse_range(const std::string& text);

struct EvaluationOptions {
    FaceRange range;
    std::vector<Region> regions{Region::head};
    FaceRegion* face_region = nullptr;  ///< needed for Region::face
    bool fit = false;
    FitOptions fitting;
    std::int64_t resolution = 0;    ///< of the pictures that are compared; 0: the model's own
    const Lpips* lpips = nullptr;   ///< also measures LPIPS with it
    bool one_by_one = false;        ///< each face on all threads instead of one face on each
    ScoreFolder* folder = nullptr;  ///< keeps what gets done; what it knows is not done again
};

/// A face as it is compared.
struct ComparedFace {
    std::int64_t index = 0;
    FitTarget target;           ///< one row, with targets up to the resolution that is compared
    std::vector<Tensor> masks;  ///< (1, S, S, 1) of each region
};

/// Throws FileError for a picture or mask that cannot be read, ValueError for a face without the code that the model starts from.
[[nodiscard]] ComparedFace compared_face(const Model& model, const Dataset& faces, std::int64_t index,
                                         const EvaluationOptions& options);

/// What can be said before any work: throws ConfigError for a range outside the set, FileError if the face's region is wanted and
/// nothing tells it for any face.
void require_comparable(const Dataset& faces, const EvaluationOptions& options);

struct Evaluation {
    std::vector<FaceScore> scores;   ///< in order of id
    std::vector<FailedFace> failed;  ///< in order of id: what cannot be read or fitted
    std::string incomplete{};        ///< after an interruption how far it came, else empty
};

/// Scores faces against the model; `loss` is what fitting minimises. A face's score does not depend on the other faces or on the
/// number of threads. After an interruption the scores so far, without those of faces whose fit was cut short. Throws what
/// require_comparable throws, and FileError if no face could be scored.
[[nodiscard]] Evaluation evaluate(const Model& model, const ReconstructionLoss& loss, const Dataset& faces,
                                  const EvaluationOptions& options);

}  // namespace stymo
