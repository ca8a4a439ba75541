#pragma once

#include <filesystem>
#include <string>

#include "render/camera.h"

namespace stymo {

/// The camera that a file holds, whichever of these it is: an object with a "pose" or with the keys
/// of one (codes.json); lines of faces.jsonl, with `id`; EG3D's dataset.json, with the name of an
/// image in `id`; or 25 (EG3D's label), 16 (4x4 world from camera) or 12 (3x4 camera from world)
/// numbers, as JSON or as plain text. `intrinsics` are those of forms that have none. Throws
/// FileError naming the file for anything else.
[[nodiscard]] Camera read_camera(const std::filesystem::path& path, const std::string& id,
                                 const Intrinsics& intrinsics);

}  // namespace stymo
