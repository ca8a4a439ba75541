#pragma once

#include <filesystem>

#include "render/morphable/head.h"

namespace stymo {

/// Reads the folder FaceXModel of ICT-FaceKit in its published form: vertex_indices.json
/// ("expressions": names, "idx_to_landmark_verts": 68 vertices), generic_neutral_mesh.obj,
/// identity000.obj, identity001.obj, ... (up to 100, without a gap) and NAME.obj for each
/// expression (up to 79), all with the same mesh in centimetres. The difference of each .obj from
/// the neutral mesh is a row of a basis; missing rows are zero. The head is then processed as in
/// read_morphable_head. Throws FileError, which names the file, for missing or malformed files.
[[nodiscard]] MorphableHead read_obj_head(const std::filesystem::path& folder);

/// Reads a scanned head from a .safetensors file: "mean" (V, 3) in centimetres, "basis.id" (100, V,
/// 3), "basis.expr" (E <= 79, V, 3) of one-sided shapes, "triangles" (T, 3), "landmarks68" (68).
/// The head is moved and scaled so that its eyes and mouth are at the positions of the built-in
/// head. The expressions are filled up to 79 with zero rows, the triangles of the neck are removed,
/// and the smooth colour basis of the built-in head is added. Throws FileError, which names the
/// file and the tensor, for tensors that are missing, have other shapes, are not finite or refer to
/// missing vertices.
[[nodiscard]] MorphableHead read_morphable_head(const std::filesystem::path& path);

/// The head that the option --morphable selects: for an empty path the built-in one, else a folder
/// of ICT-FaceKit or a .safetensors file. Throws what these readers throw, and FileError for a path
/// that does not exist.
[[nodiscard]] MorphableHead morphable_head_from(const std::filesystem::path& path);

}  // namespace stymo
