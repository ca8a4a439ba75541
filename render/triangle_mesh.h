#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// Triangles that share vertices, counter-clockwise seen from outside.
struct TriangleMesh {
    Tensor vertices;  ///< (V, 3) float32, world coordinates
    std::vector<std::array<std::int32_t, 3>> triangles;
};

/// The surface on which a scalar field has the value `level`, from its values at the vertices of a
/// grid of cubes: values (Z, Y, X) float32, x fastest; `origin` is the position of the first one.
/// Values below the level, and everything beyond the grid, are outside. Marching tetrahedra (Doi
/// and Koide 1991), six in each cube, so that no case is ambiguous: the surface is closed, and each
/// of its edges belongs to two triangles. Vertices are interpolated linearly along the edges.
/// Without a surface there are no triangles. Throws ShapeError unless there are two values or more
/// along each axis, ValueError for values that are not finite.
[[nodiscard]] TriangleMesh isosurface(const Tensor& values, const Eigen::Vector3d& origin,
                                      double spacing, double level);

/// The connected piece of a mesh with the largest volume, without the vertices of the others.
[[nodiscard]] TriangleMesh largest_piece(const TriangleMesh& mesh);

/// Volume enclosed by a closed mesh.
[[nodiscard]] double enclosed_volume(const TriangleMesh& mesh);

}  // namespace stymo
