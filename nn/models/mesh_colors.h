#pragma once

#include "nn/models/realtime/face_renderer.h"
#include "render/triangle_mesh.h"

namespace stymo {

/// Colours of the vertices of a face's mesh, (V, 3) RGB in [0, 1]: what images of the face (row 0
/// of the codes) from the usual views show there, each as much as the surface faces it. What none
/// of them sees has their mean colour. `normals` (V, 3), of length 1.
[[nodiscard]] Tensor mesh_colors(const Model& model, const Codes& codes, const TriangleMesh& mesh,
                                 const Tensor& normals, const RendererOptions& rendering);

}  // namespace stymo
