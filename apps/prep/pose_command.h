#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/common/command_line.h"

namespace stymo {

/// The options of `stymo-prep pose`. The pose comes from a file, or from angles and the position of
/// the model's camera.
struct PoseCommand {
    std::optional<std::filesystem::path> input;
    std::string id;  ///< id of the pose in a file with several poses
    double yaw = 0.0;
    double pitch = 0.0;
    double roll = 0.0;
    double distance = 5.3;
    double pivot_depth = 0.9;
    double focal = 2.03;  ///< focal length of the resulting camera
    std::optional<std::filesystem::path> out;
    std::optional<std::filesystem::path> draw;
    std::optional<std::filesystem::path> photo;
};

void declare_pose_command(Command& command, PoseCommand& options);

/// Converts a pose to every format: {"pose", "camera": {"focal", "cx", "cy"}, "world_from_camera"
/// (4x4), "camera_from_world" (3x4), "eg3d" (25 numbers)}. Writes them to `out`, and the head's
/// axes, drawn over `photo` or the built-in head, to `draw`. Throws FileError for input that is not
/// a pose.
[[nodiscard]] AppResult convert_pose(const PoseCommand& options);

}  // namespace stymo
