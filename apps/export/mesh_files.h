#pragma once

#include <filesystem>
#include <vector>

#include "fit/face_mesh.h"

namespace stymo {

/// The files are in metres, y up, the face looking along +z. Each is written completely or not at
/// all; throws FileError if it cannot be.

/// glTF 2.0, binary: the mesh with its texture, unlit because the texture holds the light, and a
/// morph target for each shape that is not missing, under ARKit's names.
void write_glb(const std::filesystem::path& path, const FaceMesh& face);
/// Wavefront OBJ, beside it a .mtl and a .png file of the same stem. Returns the three paths.
std::vector<std::filesystem::path> write_obj(const std::filesystem::path& path,
                                             const TexturedMesh& mesh);
/// The mesh with the texture's colours at its vertices.
void write_colored_ply(const std::filesystem::path& path, const TexturedMesh& mesh);

}  // namespace stymo
