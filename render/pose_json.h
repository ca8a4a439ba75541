#pragma once

#include <string_view>

#include "core/io/json_writer.h"
#include "render/camera.h"

namespace stymo {

/// A pose as codes.json and faces.jsonl hold it: {"yaw_deg", "pitch_deg", "roll_deg", "t": [x, y,
/// z]}, angles in degrees.
[[nodiscard]] JsonValue to_json(const Pose& pose);
/// The pose that the text of such an object holds. Throws FileError for text that is no JSON
/// object, for a key that is missing or unknown, and for a value that is no number within float32's
/// range. The message names the key; the caller adds the name of the file.
[[nodiscard]] Pose parse_pose(std::string_view json);

}  // namespace stymo
