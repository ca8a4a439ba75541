#pragma once

#include <span>
#include <vector>

#include "core/io/json_writer.h"
#include "render/camera.h"

namespace stymo {

/// What is known of one angle over all photos, in degrees.
struct AngleStatistics {
    double mean = 0.0;
    double deviation = 0.0;
    double lowest = 0.0;
    double highest = 0.0;
};

/// The poses of a folder as a whole, in degrees.
struct PoseStatistics {
    double pitch_offset = 0.0;  ///< median of a network's pitch, which was subtracted; 0 without a network
    double roll_offset = 0.0;   ///< likewise
    AngleStatistics yaw, pitch, roll;
};

/// Throws ValueError for no poses.
[[nodiscard]] PoseStatistics statistics_of(std::span<const Pose> poses);
/// {"pitch_offset_deg", "roll_offset_deg", "yaw_deg": {"mean", "deviation", "lowest", "highest"}, "pitch_deg", "roll_deg"}
[[nodiscard]] JsonValue to_json(const PoseStatistics& statistics);

/// Where a photo that is aligned as FFHQ is seen from, if only the head's turn is known (pivot_pose).
struct PivotCamera {
    double distance = 5.3;     ///< of the frontal camera from the head's origin, in world units
    double pivot_depth = 0.9;  ///< z of the point of the face that every aligned photo has in its middle
};

/// The poses of photos that are aligned as FFHQ from the rotations R that a network found. A network has a constant offset of
/// its own in what it calls upright; so the medians of pitch and roll over all photos are subtracted from each, and told in
/// `statistics`. Throws ValueError for no rotations.
[[nodiscard]] std::vector<Pose> poses_from_rotations(std::span<const Matrix3> rotations, const PivotCamera& camera,
                                                     PoseStatistics& statistics);

}  // namespace stymo
