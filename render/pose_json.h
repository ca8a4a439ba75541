#pragma once

#include <string_view>

#include "core/io/json_writer.h"
#include "render/camera.h"

namespace stymo {

/// The pose in the format of codes.json and faces.jsonl: {"yaw_deg", "pitch_deg", "roll_deg", "t":
/// [x, y, z]}, angles in degrees.
[[nodiscard]] JsonValue to_json(const Pose& pose);
/// Reads a pose from the text of such an object. Throws FileError for text that is not a JSON
/// object, for a missing or unknown key, for a value that is not a number within float32's range,
/// for an angle beyond 360 degrees, and for a camera nearer than 0.1 or farther than 10,000 from
/// the origin. The message names the key; the caller adds the name of the file.
[[nodiscard]] Pose parse_pose(std::string_view json);

}  // namespace stymo
