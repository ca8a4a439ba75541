#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/json_writer.h"
#include "fit/evaluation.h"

namespace stymo {

/// The compared part of the image; everything outside is black in both images.
enum class Region {
    head,  ///< with hair and ears: the mask that the model was trained with
    face   ///< of it, what is neither hair nor ear (is_face_class)
};

[[nodiscard]] const char* name_of(Region region);
/// "head", "face" or "both".
[[nodiscard]] std::vector<Region> regions_called(std::string_view text);

/// Of the way from the photo to the face that is shown.
enum class FitStage { initial, fitted, tuned };

[[nodiscard]] const char* name_of(FitStage stage);

struct RegionScore {
    Region region = Region::head;
    ImageMetrics initial;                  ///< of the encoder's codes
    std::optional<ImageMetrics> fitted{};  ///< empty without fitting
    std::optional<ImageMetrics> tuned{};   ///< of the fitted codes with the decoder tuned to the
                                           ///< photo; empty without tuning

    /// Null if it was not measured.
    [[nodiscard]] const ImageMetrics* of(FitStage stage) const;
    /// The metrics that rank a face: those of the last stage.
    [[nodiscard]] const ImageMetrics& last() const {
        return tuned ? *tuned : fitted ? *fitted : initial;
    }
};

/// Cosines between embeddings of faces (apps/eval/identity.h).
struct IdentityScore {
    double photo = 0.0;      ///< photo and fitted face
    double turned_15 = 0.0;  ///< fitted face and its views from yaw -15 and 15 degrees, their mean
    double turned_30 = 0.0;  ///< the same for 30 degrees
    double other = 0.0;      ///< photo and that of another person
};

/// In distances of the eyes (apps/eval/shape.h). Infinite: could not be measured.
struct ShapeScore {
    /// Between landmarks found in views from yaw -30 and 30 degrees and where those of the fitted
    /// face have turned to; mean over the points within the jaw and over the views.
    double landmarks_30 = std::numeric_limits<double>::infinity();
    double found_30 = 0.0;  ///< share of these views in which a face was found
    /// Median difference of depth from the linear head's surface, over the face, after a shift.
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
/// "counting_samples", "identity": {"photo", "turned_15", "turned_30", "other"},
/// "tuned_identity": {...}, "shape": {"landmarks_30", "found_30", "depth"}, "tuned_shape": {...}},
/// of these what was measured.
/// Numbers read back to the same value; infinite ones become null.
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

/// The rows as text.
[[nodiscard]] std::string table(const std::vector<FaceScore>& scores);
/// {"count", "mean": {"head": {"initial": {...}, "fitted": {...}}, ...}, "median": the same,
/// "counting_samples", "identity", "tuned_identity", "shape" and "tuned_shape" if they were
/// measured, as means over the faces where they were, "failed": [{"id", "reason"}]}
[[nodiscard]] JsonValue summary_json(const std::vector<FaceScore>& scores,
                                     const std::vector<FailedFace>& failed);

}  // namespace stymo
