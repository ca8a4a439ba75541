#pragma once

#include "nn/realtime/face_renderer.h"
#include "render/triangle_mesh.h"

namespace stymo {

/// Colours of the vertices of a face's mesh, (V, 3) RGB in [0, 1]. The face (row 0 of `codes`) is
/// rendered from several views. A vertex has the mean of its colours in the views that see it,
/// weighted by how directly the surface faces the camera. Vertices that no view sees
/// continue the others' colours over the surface (continued_colors). `normals` (V, 3) have unit
/// length.
[[nodiscard]] Tensor mesh_colors(const Model& model, const Codes& codes, const TriangleMesh& mesh,
                                 const Tensor& normals, const RendererOptions& rendering);

}  // namespace stymo
