#pragma once

#include <Eigen/Core>

#include "core/tensor.h"
#include "render/camera.h"

/// Depth maps: float32 (R, R, 1) with R >= 2, Euclidean distances from the camera along rays
/// through the centres of pixels. Image points are in units of the image's side.
namespace stymo {

/// Unit vector from the camera through an image point, in the camera's axes: x right, y down, z
/// forward.
[[nodiscard]] Eigen::Vector3d direction_at(const Intrinsics& intrinsics,
                                           const Eigen::Vector2d& image_point);

/// The depth at an image point, interpolated bilinearly between pixel centres and clamped at the
/// border.
[[nodiscard]] double depth_at(const Tensor& depths, const Eigen::Vector2d& image_point);

/// The point in the world that the camera sees at an image point.
[[nodiscard]] Eigen::Vector3d point_at(const Camera& camera, const Tensor& depths,
                                       const Eigen::Vector2d& image_point);

}  // namespace stymo
