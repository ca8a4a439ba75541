#pragma once

#include "core/autograd/variable.h"
#include "render/camera.h"

/// The camera as a differentiable map. Not part of the public interface.
namespace stymo::morphable {

/// Each row with a pose (N, 6) of its own (state.h), so that one gradient of a column's sum is a
/// whole column of Jacobians. World points (N, 3) in the camera's axes, (N, 3).
[[nodiscard]] Variable camera_points(const Variable& poses, const Variable& points);
/// World directions in the camera's axes: the rotation alone.
[[nodiscard]] Variable camera_directions(const Variable& poses, const Variable& directions);
/// Points in the camera's axes -> image coordinates (N, 2) in units of the image side, x right and
/// y down.
[[nodiscard]] Variable image_points(const Variable& camera_points, const Intrinsics& intrinsics);
/// Column `index` of (N, C), as (N, 1).
[[nodiscard]] Variable column(const Variable& x, std::int64_t index);

}  // namespace stymo::morphable
