#include "fit/photo/network_poses.h"

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/error.h"
#include "core/median.h"

namespace stymo {
namespace {

AngleStatistics statistics_of(std::span<const Pose> poses, double Pose::*angle) {
    AngleStatistics result{0.0, 0.0, poses.front().*angle, poses.front().*angle};
    const auto count = static_cast<double>(poses.size());
    for (const Pose& pose : poses) {
        result.mean += pose.*angle / count;
        result.lowest = std::min(result.lowest, pose.*angle);
        result.highest = std::max(result.highest, pose.*angle);
    }
    double variance = 0.0;
    for (const Pose& pose : poses)
        variance += (pose.*angle - result.mean) * (pose.*angle - result.mean) / count;
    result.deviation = std::sqrt(variance);
    for (double* value : {&result.mean, &result.deviation, &result.lowest, &result.highest})
        *value = degrees_from_radians(*value);
    return result;
}

JsonValue to_json(const AngleStatistics& angle) {
    return JsonValue::object({{"mean", angle.mean},
                              {"deviation", angle.deviation},
                              {"lowest", angle.lowest},
                              {"highest", angle.highest}});
}

}  // namespace

PoseStatistics statistics_of(std::span<const Pose> poses) {
    if (poses.empty()) fail<ValueError>("[poses] there are no poses");
    return {.yaw = statistics_of(poses, &Pose::yaw),
            .pitch = statistics_of(poses, &Pose::pitch),
            .roll = statistics_of(poses, &Pose::roll)};
}

JsonValue to_json(const PoseStatistics& statistics) {
    return JsonValue::object({{"pitch_offset_deg", statistics.pitch_offset},
                              {"roll_offset_deg", statistics.roll_offset},
                              {"yaw_deg", to_json(statistics.yaw)},
                              {"pitch_deg", to_json(statistics.pitch)},
                              {"roll_deg", to_json(statistics.roll)}});
}

std::vector<Pose> poses_from_rotations(std::span<const Eigen::Matrix3d> rotations,
                                       const PivotCamera& camera, PoseStatistics& statistics) {
    if (rotations.empty()) fail<ValueError>("[poses] there are no rotations");
    std::vector<Eigen::Vector3d> angles;
    std::vector<double> pitches, rolls;
    for (const Eigen::Matrix3d& rotation : rotations) {
        angles.push_back(angles_from_rotation(rotation));
        pitches.push_back(angles.back()[1]);
        rolls.push_back(angles.back()[2]);
    }
    const double pitch_offset = median(pitches);
    const double roll_offset = median(rolls);
    std::vector<Pose> poses;
    for (const Eigen::Vector3d& angle : angles)
        poses.push_back(pivot_pose(angle[0], angle[1] - pitch_offset, angle[2] - roll_offset,
                                   camera.distance, camera.pivot_depth));
    statistics = statistics_of(poses);
    statistics.pitch_offset = degrees_from_radians(pitch_offset);
    statistics.roll_offset = degrees_from_radians(roll_offset);
    return poses;
}

}  // namespace stymo
