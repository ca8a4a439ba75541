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
    std::string id;  ///< of the pose in a file with several
    double yaw = 0.0;
    double pitch = 0.0;
    double roll = 0.0;
    double distance = 5.3;
    double pivot_depth = 0.9;
    double focal = 2.03;  ///< of the camera that comes out
    std::optional<std::filesystem::path> out;
    std::optional<std::filesystem::path> draw;
    std::optional<std::filesystem::path> photo;
};

void declare_pose_command(Command& command, PoseCommand& options);

/// The pose in every form: {"pose", "camera": {"focal", "cx", "cy"}, "world_from_camera" (4x4),
/// "camera_from_world" (3x4), "eg3d" (25 numbers)}. Writes it to `out`, and the head's axes, over
/// `photo` or the built-in head, to `draw`. Throws FileError for input that cannot be read as a
/// pose.
[[nodiscard]] AppResult convert_pose(const PoseCommand& options);

}  // namespace stymo
