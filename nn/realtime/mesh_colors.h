#pragma once

#include <filesystem>

#include "nn/realtime/face_renderer.h"
#include "nn/realtime/head_mesh.h"
#include "render/triangle_mesh.h"

namespace stymo {

/// Colours of the vertices of a face's mesh, (V, 3) RGB in [0, 1]. The face (row 0 of `codes`) is
/// rendered from several views. A vertex has the mean of its colours in the views that see it,
/// weighted by how directly the surface faces the camera. Vertices that no view sees
/// continue the others' colours over the surface (continued_colors). `normals` (V, 3) have unit
/// length.
[[nodiscard]] Tensor mesh_colors(const Model& model, const Codes& codes, const TriangleMesh& mesh,
                                 const Tensor& normals, const RendererOptions& rendering);

/// Writes the head's mesh (head_mesh) of row 0 of `codes` as a .ply file, with normals and with the
/// colours of exact frames. Throws what head_mesh and write_ply throw.
void write_head_ply(const std::filesystem::path& path, const Model& model, const Codes& codes,
                    const HeadMeshOptions& meshing, RendererOptions rendering = {});

}  // namespace stymo
