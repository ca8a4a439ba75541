#pragma once

#include <filesystem>

#include "render/morphable/head.h"

namespace stymo {

/// The head that the option --morphable selects: for an empty path the built-in one, else a folder
/// of ICT-FaceKit (obj_head.h) or a .safetensors file (head_file.h). Throws what these readers
/// throw, and FileError for a path that does not exist.
[[nodiscard]] MorphableHead morphable_head_from(const std::filesystem::path& path);

}  // namespace stymo
