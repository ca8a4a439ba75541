#pragma once

#include <filesystem>

#include "render/morphable/head.h"

namespace stymo {

/// Reads a scanned head from a .safetensors file: "mean" (V, 3) in centimetres, "basis.id" (100, V,
/// 3), "basis.expr" (E <= 79, V, 3) of one-sided shapes, "triangles" (T, 3), "landmarks68" (68).
/// Moves and scales it to where the built-in head has its eyes and mouth, fills the expressions up
/// to 79 with zero rows, drops the triangles of the neck, and gives it the built-in smooth colour
/// basis. Throws FileError, naming the file and the tensor, for tensors that are missing, have
/// other shapes, are not finite or refer to missing vertices.
[[nodiscard]] MorphableHead read_morphable_head(const std::filesystem::path& path);

}  // namespace stymo
