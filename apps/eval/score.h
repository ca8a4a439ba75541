#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/common/result_folder.h"
#include "apps/common/table.h"
#include "core/io/json_writer.h"
#include "fit/fit_report.h"
#include "fit/fitter.h"

namespace stymo {

/// The compared part of the image; everything outside is black in both images.
enum class Region {
    head,  ///< with hair and ears: the mask that the model was trained with
    face   ///< the head without hair and ears (is_face_class)
};

[[nodiscard]] const char* name_of(Region region);
/// The regions for "head", "face" or "both".
[[nodiscard]] std::vector<Region> regions_called(std::string_view text);

/// The stages from the initial codes to the final face.
enum class FitStage { initial, fitted, tuned };

[[nodiscard]] const char* name_of(FitStage stage);

struct RegionScore {
    Region region = Region::head;
    ImageMetrics initial;                  ///< of the initial codes
    std::optional<ImageMetrics> fitted{};  ///< empty without fitting
    std::optional<ImageMetrics> tuned{};   ///< of the fitted codes with the decoder tuned to the
                                           ///< photo; empty without tuning

    /// The metrics of a stage; null if it was not measured.
    [[nodiscard]] const ImageMetrics* of(FitStage stage) const;
    /// The metrics that rank a face: those of the last stage.
    [[nodiscard]] const ImageMetrics& last() const {
        return tuned ? *tuned : fitted ? *fitted : initial;
    }
};

/// Cosines between embeddings of faces (apps/eval/person_measures.h).
struct IdentityScore {
    double photo = 0.0;      ///< photo and fitted face
    double turned_15 = 0.0;  ///< mean over fitted face and its views at yaw -15 and 15 degrees
    double turned_30 = 0.0;  ///< the same for 30 degrees
    double other = 0.0;      ///< photo and photo of another person; infinite if there is none
};

/// Shape errors in units of the distance of the eyes (apps/eval/person_measures.h). Infinite if
/// they could not be measured.
struct ShapeScore {
    /// Mean distance, in views at yaw -30 and 30 degrees, between the landmarks that are found and
    /// the landmarks of the fitted face turned to the view; over the points inside the jaw line and
    /// over the views.
    double landmarks_30 = std::numeric_limits<double>::infinity();
    double found_30 = 0.0;  ///< share of these views in which a face is found
    /// Median difference of the depth from the linear head's surface over the face, after a common
    /// shift (shifted_difference).
    double depth = std::numeric_limits<double>::infinity();
};

struct FaceScore {
    std::string id;
    std::vector<RegionScore> regions;  ///< at least one; the same for all faces of an evaluation
    double counting_samples = 1.0;     ///< View::significant_samples of the fitted face
    std::optional<IdentityScore> identity{};        ///< empty: not measured
    std::optional<IdentityScore> tuned_identity{};  ///< of the tuned decoder
    std::optional<ShapeScore> shape{};              ///< empty: not measured
    std::optional<ShapeScore> tuned_shape{};        ///< of the tuned decoder
};

/// A face that has no score, and why.
struct FailedFace {
    std::string id;
    std::string reason;
};

/// One line: {"id", "head": {"initial": {...}, "fitted": {...}, "tuned": {...}}, "face": ...,
/// "counting_samples", "identity": {"photo", "turned_15", "turned_30", "other"}, "tuned_identity":
/// {...}, "shape": {"landmarks_30", "found_30", "depth"}, "tuned_shape": {...}}, without values
/// that were not measured. Numbers can be read back exactly; infinite ones become null.
[[nodiscard]] JsonValue to_json(const FaceScore& score);
/// Throws FileError for text that to_json did not write.
[[nodiscard]] FaceScore parse_face_score(std::string_view line);

/// A row of the tables: the mean or median of each metric over all faces, for one region and one
/// stage.
struct SummaryRow {
    Region region = Region::head;
    FitStage stage = FitStage::initial;
    bool median = false;  ///< else the mean
    ImageMetrics metrics;
};

/// Rows by region, then stage, then mean and median.
[[nodiscard]] std::vector<SummaryRow> summary(const std::vector<FaceScore>& scores);
[[nodiscard]] double mean_counting_samples(const std::vector<FaceScore>& scores);

/// The rows; the column of LPIPS is hidden if no face has it.
[[nodiscard]] Table summary_table(const std::vector<FaceScore>& scores);
/// That table, and the other means, for people.
[[nodiscard]] std::string summary_text(const std::vector<FaceScore>& scores);
/// {"count", "mean": {"head": {"initial": {...}, "fitted": {...}}, ...}, "median": the same,
/// "counting_samples", "identity", "tuned_identity", "shape" and "tuned_shape" if they were
/// measured, as means over the faces where they were, "failed": [{"id", "reason"}]}
[[nodiscard]] JsonValue summary_json(const std::vector<FaceScore>& scores,
                                     const std::vector<FailedFace>& failed);

/// Stores an evaluation face by face, so that it can continue after an interruption: settings.json,
/// one line per face in scores.jsonl, the fitted codes in codes/ID.json, and the weight changes of
/// tuning in tuned/ID.safetensors.
class ScoreFolder {
public:
    /// Continues the folder, or will begin one, whose codes get this mark of their model. Throws
    /// what ResultFolder throws.
    ScoreFolder(const std::filesystem::path& path, const Settings& settings, std::string mark,
                Ranks& ranks)
        : results_(path, settings, "scores", "id", ranks), mark_(std::move(mark)) {}

    [[nodiscard]] ResultFolder& results() { return results_; }
    /// The score of a face that has one. Throws FileError for a line that is none.
    [[nodiscard]] FaceScore score(const std::string& id) const {
        return results_.read(id, parse_face_score);
    }
    [[nodiscard]] std::filesystem::path codes_of(const std::string& id) const {
        return results_.path() / "codes" / (id + ".json");
    }
    /// The file of the weight changes of tuning. Creates its folder.
    [[nodiscard]] std::filesystem::path tuned_of(const std::string& id) const;
    /// Adds a score, and the codes of the fit if the face was fitted. Both are on the disk when
    /// this function returns. Not thread-safe.
    void add(const FaceScore& score, const FitResult& fit);

private:
    ResultFolder results_;
    std::string mark_;
};

}  // namespace stymo
