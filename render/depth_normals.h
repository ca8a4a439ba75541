#pragma once

#include "core/tensor.h"
#include "render/rays.h"

namespace stymo {

/// Normals of the surface that a depth map (R, R, 1) shows, as unit vectors (R, R, 3) in world axes
/// that point to the camera's side, from central differences. `depth` holds the distance along each
/// ray of `sampling` (rays_per_side = R). Zero where the surface has no direction. Throws
/// ShapeError for a depth map of another size.
[[nodiscard]] Tensor depth_normals(const Tensor& depth, const Camera& camera,
                                   const RaySampling& sampling);

}  // namespace stymo
