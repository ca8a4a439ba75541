#pragma once

#include <span>
#include <vector>

#include "core/io/json_writer.h"
#include "render/camera.h"

namespace stymo {

/// Statistics of one angle over all photos, in degrees.
struct AngleStatistics {
    double mean = 0.0;
    double deviation = 0.0;
    double lowest = 0.0;
    double highest = 0.0;
};

/// Statistics of the poses of a folder, in degrees.
struct PoseStatistics {
    /// Median of a network's pitch, which was subtracted; 0 without a network.
    double pitch_offset = 0.0;
    double roll_offset = 0.0;  ///< the same for the roll
    AngleStatistics yaw, pitch, roll;
};

/// Throws ValueError without poses.
[[nodiscard]] PoseStatistics statistics_of(std::span<const Pose> poses);
/// {"pitch_offset_deg", "roll_offset_deg", "yaw_deg": {"mean", "deviation", "lowest", "highest"},
/// "pitch_deg", "roll_deg"}
[[nodiscard]] JsonValue to_json(const PoseStatistics& statistics);

/// The camera position of a photo that is aligned like FFHQ, if only the rotation of the head is
/// known (pivot_pose).
struct PivotCamera {
    /// Distance of the frontal camera from the head's origin, in world units.
    double distance = 5.3;
    /// World z of the point on the face that is in the middle of every aligned photo.
    double pivot_depth = 0.9;
};

/// The poses of photos that are aligned like FFHQ, from the rotations R that a network found.
/// Networks differ by a constant in what they define as upright, so the medians of pitch and roll
/// over all photos are subtracted and recorded in `statistics`. Throws ValueError without
/// rotations.
[[nodiscard]] std::vector<Pose> poses_from_rotations(std::span<const Eigen::Matrix3d> rotations,
                                                     const PivotCamera& camera,
                                                     PoseStatistics& statistics);

}  // namespace stymo
