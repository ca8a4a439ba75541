#pragma once

#include <span>
#include <vector>

#include "core/autograd/variable.h"
#include "render/rays.h"

namespace stymo {

/// Poses as they are learnt, (B, 6): yaw, pitch, roll in radians, then R^T t, the camera's centre
/// along the axes that turn with it (right, up, towards the camera). A change of the angles alone
/// is an orbit around the head, whatever the distance.
[[nodiscard]] Tensor orbit_parameters(std::span<const Pose> poses, DType dtype = DType::float32);
/// Row `index` of such parameters as a pose.
[[nodiscard]] Pose pose_from_orbit(const Tensor& parameters, std::int64_t index);

/// The points of rays as a function of the cameras' poses, which gradients flow to: (B, R * N, 3)
/// for orbit parameters (B, 6), the intrinsics of each camera, and depths (B, R, N) as sample_rays
/// gives them. The depths count as constants: where samples stand on a ray does not change the
/// integral along it. Throws ShapeError for extents that do not fit.
[[nodiscard]] Variable tracked_points(const Variable& orbits, const std::vector<Camera>& cameras,
                                      const RaySampling& sampling, const Tensor& depths);

}  // namespace stymo
