#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "render/camera.h"
#include "train/face_picture.h"
#include "train/pose_network.h"

namespace stymo {

struct PrepareSettings {
    std::int64_t side = 256;   ///< of the images and masks written, in pixels
    double distance = 5.3;     ///< of the frontal camera from the head's origin, in world units
    double pivot_depth = 0.9;  ///< z of the point of the face that every aligned photo has in its middle (pivot_pose)
    bool overlays = false;     ///< draw the heads' axes over the photos; needs a pose network
};

/// What is known of one angle over all photos, in degrees.
struct AngleStatistics {
    double mean = 0.0;
    double deviation = 0.0;
    double lowest = 0.0;
    double highest = 0.0;
};

/// The poses of a prepared folder as a whole, in degrees.
struct PoseReport {
    double pitch_offset = 0.0;  ///< median of the network's pitch, which was subtracted
    double roll_offset = 0.0;   ///< likewise
    AngleStatistics yaw, pitch, roll;
};

struct PrepareReport {
    std::int64_t found = 0;
    std::int64_t ok = 0;
    std::int64_t without_mask = 0;  ///< of those that are ok; no mask is written, which stands for the whole frame
    std::vector<BrokenFile> failed;
    std::optional<PoseReport> poses;  ///< none without a pose network
};

/// {"found", "ok", "without_mask", "failed": [{"file", "reason"}], "poses": {"pitch_offset_deg", "roll_offset_deg", "yaw_deg":
/// {"mean", "deviation", "lowest", "highest"}, "pitch_deg", "roll_deg"} or null}
[[nodiscard]] JsonValue to_json(const PrepareReport& report);

/// The poses of photos that are aligned as FFHQ from the rotations R that a network found. A network has a constant offset of
/// its own in what it calls upright; so the medians of pitch and roll over all photos are subtracted from each.
[[nodiscard]] std::vector<Pose> poses_from_rotations(const std::vector<Matrix3>& rotations, const PrepareSettings& settings,
                                                     PoseReport& report);

/// Makes a training set of a folder of aligned photos, as scan_folder reads it: images/ID.png and masks/ID.png resampled by
/// antialiased bicubic, faces.jsonl, camera.json, report.json, and with overlays overlays/axes_NNN.png of 64 photos each. A photo
/// that cannot be used is named in the report. Poses and codes that the folder's own faces.jsonl has are not carried over;
/// without a network the set has no poses, which stands for frontal ones.
///
/// `folder` appears as a whole at the end or not at all. Throws FileError if it exists and is not empty, if there is no photo
/// that can be used, or if it cannot be written; Error if a signal was noted (core/interrupt.h). `progress` is called with the
/// number of photos looked at and of all.
[[nodiscard]] PrepareReport prepare_aligned_photos(const std::filesystem::path& photos, const std::filesystem::path& folder,
                                                   const PrepareSettings& settings, PoseNetwork* network,
                                                   const std::function<void(std::int64_t, std::int64_t)>& progress = {});

}  // namespace stymo
