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

}  // namespace stymo
