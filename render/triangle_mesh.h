#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// Triangles that share vertices, counter-clockwise seen from outside.
struct TriangleMesh {
    Tensor vertices;  ///< (V, 3) float32, world coordinates
    std::vector<std::array<std::int32_t, 3>> triangles;
};

/// The isosurface of a scalar field at `level`. values (Z, Y, X) float32 are its values at the
/// vertices of a grid of cubes, x fastest; `origin` is the position of the first vertex. Values
/// below the level, and everything beyond the grid, are outside. Computed by marching tetrahedra
/// (Doi and Koide 1991) with six tetrahedra in each cube, which has no ambiguous cases: the surface
/// is closed, and each of its edges belongs to two triangles. Vertices are interpolated linearly
/// along the edges. If there is no surface, the mesh has no triangles. Throws ShapeError for fewer
/// than two values along an axis, ValueError for values that are not finite.
[[nodiscard]] TriangleMesh isosurface(const Tensor& values, const Eigen::Vector3d& origin,
                                      double spacing, double level);

/// For each of the vertices a representative of its connected piece, the same for the whole piece.
[[nodiscard]] std::vector<std::int32_t> pieces_of(
    std::int64_t vertex_count, std::span<const std::array<std::int32_t, 3>> triangles);

/// The connected piece of a mesh that encloses the largest volume, without the vertices of other
/// pieces.
[[nodiscard]] TriangleMesh largest_piece(const TriangleMesh& mesh);

}  // namespace stymo
