#pragma once

#include "core/tensor.h"
#include "render/rays.h"

namespace stymo {

/// Surface normals of a depth map (R, R, 1) by central differences: unit vectors (R, R, 3) in world
/// axes that point towards the camera's side. `depth` holds the distance along each ray of
/// `sampling` (rays_per_side = R). A normal that cannot be determined is zero. Throws ShapeError
/// for a depth map of another size.
[[nodiscard]] Tensor depth_normals(const Tensor& depth, const Camera& camera,
                                   const RaySampling& sampling);

}  // namespace stymo
