#pragma once

#include <filesystem>

#include "render/morphable/head.h"

namespace stymo {

/// Reads a scanned head from a .safetensors file: "mean" (V, 3) in centimetres, "basis.id" (100, V,
/// 3), "basis.expr" (E <= 79, V, 3) of one-sided shapes, "triangles" (T, 3), "landmarks68" (68).
/// The head is moved and scaled so that its eyes and mouth are at the positions of the built-in
/// head. The expressions are filled up to 79 with zero rows, the triangles of the neck are removed,
/// and the smooth colour basis of the built-in head is added. Throws FileError, which names the
/// file and the tensor, for tensors that are missing, have other shapes, are not finite or refer to
/// missing vertices.
[[nodiscard]] MorphableHead read_morphable_head(const std::filesystem::path& path);

}  // namespace stymo
