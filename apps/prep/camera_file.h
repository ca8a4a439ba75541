#pragma once

#include <filesystem>
#include <string>

#include "render/camera.h"

namespace stymo {

/// Reads a camera from a file in one of these formats: a JSON object with a "pose" or with the keys
/// of a pose (codes.json), and perhaps a "camera" with its intrinsics; faces.jsonl, with the face's
/// `id` and the intrinsics of camera.json beside it; EG3D's dataset.json, with the name of an image
/// in `id`; 25 (EG3D's label), 16 (4x4 world from camera) or 12 (3x4 camera from world) numbers, as
/// JSON or plain text. `intrinsics` are used for formats without intrinsics. Throws FileError,
/// which names the file, for anything else.
[[nodiscard]] Camera read_camera(const std::filesystem::path& path, const std::string& id,
                                 const Intrinsics& intrinsics);

}  // namespace stymo
