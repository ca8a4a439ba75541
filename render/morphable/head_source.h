#pragma once

#include <filesystem>
#include <optional>

#include "render/morphable/head.h"

namespace stymo {

/// The head that --morphable names: the built-in one without a path, a folder of ICT-FaceKit as it
/// is published (obj_head.h), or a .safetensors file (head_file.h). Throws FileError as these do,
/// and for a path that does not exist.
[[nodiscard]] MorphableHead morphable_head_from(const std::optional<std::filesystem::path>& path);

}  // namespace stymo
