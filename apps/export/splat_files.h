#pragma once

#include <filesystem>

#include "render/splats.h"

namespace stymo {

/// Files of splats for viewers, in metres. Each is written completely or not at all; throws
/// FileError if it cannot be.

/// PLY with the columns of Kerbl et al. 2023, and their axes: y down, the face looking along -z.
void write_splat_ply(const std::filesystem::path& path, const Splats& splats);
/// SPZ, version 2 (Niantic): y up, the face looking along +z; about a fifth of the size.
void write_spz(const std::filesystem::path& path, const Splats& splats);

}  // namespace stymo
