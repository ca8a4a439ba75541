#pragma once

#include <filesystem>
#include <optional>

#include "render/morphable/head.h"

namespace stymo {

/// The head that the option --morphable selects: without a path the built-in one, else a folder of
/// ICT-FaceKit (obj_head.h) or a .safetensors file (head_file.h). Throws what these readers throw,
/// and FileError for a path that does not exist.
[[nodiscard]] MorphableHead morphable_head_from(const std::optional<std::filesystem::path>& path);

}  // namespace stymo
