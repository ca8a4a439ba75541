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

/// The surface on which a scalar field has the value `level`, from its values at the vertices of a lattice of cubes: values
/// (Z, Y, X) float32, x fastest, `origin` the place of the first one. Outside is where values are below the level, and all that
/// lies beyond the lattice. Marching tetrahedra (Doi and Koide 1991), six in each cube, so that no case is ambiguous: the surface
/// is closed, and each of its edges belongs to two triangles. Vertices lie where the field is the level if it is linear along an
/// edge. No surface: no triangles. Throws ShapeError unless there are two values or more along each axis, ValueError for values
/// that are not finite.
[[nodiscard]] TriangleMesh isosurface(const Tensor& values, const Vector3& origin, double spacing, double level);

/// The one of the connected pieces of a mesh that encloses most space; vertices that are left over are gone.
[[nodiscard]] TriangleMesh largest_piece(const TriangleMesh& mesh);

/// Space that a closed mesh encloses.
[[nodiscard]] double enclosed_volume(const TriangleMesh& mesh);

}  // namespace stymo
