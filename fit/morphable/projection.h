#pragma once

#include "core/autograd/variable.h"
#include "render/camera.h"

/// The projection of a camera as differentiable functions. Not part of the public interface.
namespace stymo::morphable {

/// World points (N, 3) -> points in the camera's axes (N, 3). Each row has its own pose (N, 6)
/// (state.h), so that the gradient of the sum of a column gives the Jacobians of all rows.
[[nodiscard]] Variable camera_points(const Variable& poses, const Variable& points);
/// World directions (N, 3) -> directions in the camera's axes: only the rotation.
[[nodiscard]] Variable camera_directions(const Variable& poses, const Variable& directions);
/// Points in the camera's axes -> image coordinates (N, 2) in units of the image side, x right and
/// y down.
[[nodiscard]] Variable image_points(const Variable& camera_points, const Intrinsics& intrinsics);
/// Column `index` of (N, C), as (N, 1).
[[nodiscard]] Variable column(const Variable& x, std::int64_t index);

}  // namespace stymo::morphable
