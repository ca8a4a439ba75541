#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "apps/eval/score.h"
#include "core/tensor.h"
#include "fit/fit_job.h"
#include "fit/photo/face_parser.h"
#include "train/data/dataset.h"
#include "train/data/face_image.h"

namespace stymo {

/// The mask of the face without hair and ears: from the folder's parsing maps or annotated parts,
/// else from a face parser.
class FaceRegion {
public:
    /// `parser`: an ONNX file, or empty for none. Throws what FaceParser throws.
    explicit FaceRegion(const std::filesystem::path& parser = {});

    /// Whether `mask` can determine the region.
    [[nodiscard]] bool tells(const FaceFiles& files) const {
        return parser_ || tells_face_region(files);
    }
    /// The mask (side, side, 1) in [0, 1] for the photo's central square. Thread-safe. Throws
    /// FileError for a file that cannot be read, or if there is neither a parsing map nor a parser.
    [[nodiscard]] Tensor mask(const FaceFiles& files, std::int64_t side);

private:
    std::optional<FaceParser> parser_;
    std::mutex parsing_;
};

class IdentityMeasure;
class ShapeMeasure;

/// Faces of a folder: a range of positions, or those that a file lists.
struct FaceRange {
    std::int64_t first = 0;
    std::int64_t last = -1;  ///< inclusive; -1: to the end
    std::filesystem::path list{};
    std::vector<std::string> ids{};  ///< of the lines of `list`; empty: the range counts
};

/// "700-799", "700-", "5", or a file that holds one id in each line. Throws UsageError for anything
/// else, FileError, which names the line, for an id that is empty or listed twice.
[[nodiscard]] FaceRange parse_range(const std::string& text);
/// The positions of a range in a folder, in order. Throws ConfigError for a range beyond its end,
/// FileError, which names the line, for an id that the folder does not have.
[[nodiscard]] std::vector<std::int64_t> positions_of(const Dataset& faces, const FaceRange& range);

struct EvaluationOptions {
    FaceRange range;
    std::vector<Region> regions{Region::head};
    FaceRegion* face_region = nullptr;  ///< required for Region::face
    bool fit = false;                   ///< fits each face, and tunes the decoder if the job does
    std::int64_t resolution = 0;        ///< side of the compared images; 0: the model's resolution
    const Lpips* lpips = nullptr;       ///< null: LPIPS is not measured
    const IdentityMeasure* identity = nullptr;  ///< null: identity is not measured
    const ShapeMeasure* shape = nullptr;        ///< null: shape is not measured
    bool one_by_one = false;  ///< evaluates each face on all threads instead of one face on each
                              ///< thread; always so with tuning
    /// Stores scores as they are computed; stored faces are not scored again. Null: nothing is
    /// stored.
    ScoreFolder* folder = nullptr;
    Ranks* ranks = nullptr;  ///< they share the faces; null: this process has all
};

/// A face of the data set, prepared for the comparison.
struct ComparedFace {
    std::int64_t index = 0;
    FaceBatch batch;            ///< one row, with targets up to the compared resolution
    std::vector<Tensor> masks;  ///< (1, S, S, 1) for each region
};

/// Loads face `index`. Throws FileError for an image or mask that cannot be read, ValueError for a
/// face without the code that the model requires.
[[nodiscard]] ComparedFace compared_face(const Model& model, const Dataset& faces,
                                         std::int64_t index, const EvaluationOptions& options);

/// Checks the settings before the work. Throws ConfigError for a range outside the set, FileError
/// if the face region is selected but cannot be found for any face.
void require_comparable(const Dataset& faces, const EvaluationOptions& options);

struct Evaluation {
    std::vector<FaceScore> scores;   ///< in order of id
    std::vector<FailedFace> failed;  ///< in order of id: faces that cannot be read or fitted
    std::string incomplete{};        ///< progress at an interruption; empty if it is complete
};

/// Scores faces against the job's model. A face's score does not depend on the other faces or on
/// the number of threads or ranks. When interrupted, it returns the scores so far, without faces
/// whose fit was not finished. Only the first rank returns scores, those of all ranks. Throws what
/// require_comparable throws, and FileError if no face could be scored.
[[nodiscard]] Evaluation evaluate(const FitJob& job, const Dataset& faces,
                                  const EvaluationOptions& options);

/// The split with the name "train", "val" or "test"; all faces for an empty name. Throws UsageError
/// for another name.
[[nodiscard]] Split split_called(const std::string& name);
/// How the training run of a model file split its data: "data" in the config.json next to the file,
/// or in the run folder of its checkpoint. Throws FileError if there is none.
[[nodiscard]] DataConfig split_of_run(const std::filesystem::path& model);

}  // namespace stymo
