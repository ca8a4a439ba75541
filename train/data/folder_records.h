#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render/camera.h"

namespace stymo {

/// Reads "photos" of the `report.json` that stymo-prep writes: the ids of all photos that were
/// there. Empty for a file of another kind.
[[nodiscard]] std::vector<std::string> read_photo_ids(const std::filesystem::path& path);

/// Reads `camera.json`: {"focal", "cx", "cy"} in units of the image side, each optional. Throws
/// FileError for malformed JSON, an unknown key, a wrong type or a focal length out of range.
[[nodiscard]] Intrinsics read_intrinsics(const std::filesystem::path& path);
/// Writes such a `camera.json`, whole or not at all.
void write_intrinsics(const std::filesystem::path& path, const Intrinsics& intrinsics);

}  // namespace stymo
