#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/json_writer.h"
#include "fit/photo/photo_preparation.h"
#include "train/data/folder_records.h"

namespace stymo {

/// The record of a prepared face, without its image and mask.
struct FaceOutcome {
    std::string id;
    MorphableFit fit;
    Landmarks landmarks;
    std::optional<Eigen::Matrix3d> network_rotation;
    std::optional<double> mask_agreement;
    bool was_aligned = false;
    bool made_mask = false;
    std::vector<std::string> warnings;
    PhotoOrigin origin;
};

/// The outcome of one photo. `failure` says why it cannot be used, or is empty.
struct PhotoOutcome {
    std::string file;  ///< relative to the folder of photos
    std::string failure;
    std::vector<FaceOutcome> faces;
};

[[nodiscard]] FaceOutcome outcome_of(std::string id, PreparedFace face);

/// One line, from which `parse_photo_outcome` restores the same values.
[[nodiscard]] JsonValue to_json(const PhotoOutcome& outcome);
/// Throws FileError for text that to_json did not write.
[[nodiscard]] PhotoOutcome parse_photo_outcome(std::string_view line);

/// A line of faces.jsonl.
[[nodiscard]] JsonValue face_record(const FaceOutcome& face, const Pose& pose);

}  // namespace stymo
