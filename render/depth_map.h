#pragma once

#include <Eigen/Core>

#include "core/tensor.h"
#include "render/camera.h"

/// Depth maps: float32 (R, R, 1), Euclidean distances from the camera along rays through the
/// middles of their pixels. Places are in units of the image's side.
namespace stymo {

/// x right, y down, z forward in the camera's axes, of length 1.
[[nodiscard]] Eigen::Vector3d direction_at(const Intrinsics& intrinsics,
                                           const Eigen::Vector2d& place);

/// The depth at a place, interpolated linearly; beyond the outer pixels' middles, theirs.
[[nodiscard]] double depth_at(const Tensor& depths, const Eigen::Vector2d& place);

/// The point in the world that the camera sees at a place.
[[nodiscard]] Eigen::Vector3d point_at(const Camera& camera, const Tensor& depths,
                                       const Eigen::Vector2d& place);

}  // namespace stymo
