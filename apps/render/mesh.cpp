#include "apps/render/mesh.h"

#include "core/io/ply_file.h"
#include "nn/models/mesh_colors.h"
#include "render/morphable/head.h"

namespace stymo {

void write_mesh(const RenderOptions& options, const Model& model, const CodeFile& face) {
    const TriangleMesh mesh = head_mesh(model, face.codes, 0, options.meshing);
    const Tensor normals = vertex_normals(mesh.vertices, mesh.triangles);
    write_ply(options.mesh, {.vertices = mesh.vertices,
                             .normals = normals,
                             .colors = mesh_colors(model, face.codes, mesh, normals, options.renderer),
                             .triangles = mesh.triangles});
}

}  // namespace stymo
