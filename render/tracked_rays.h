#pragma once

#include <span>
#include <vector>

#include "core/autograd/variable.h"
#include "render/rays.h"

namespace stymo {

/// Orbit parameters (B, 6) of poses, in which poses are optimised: yaw, pitch, roll in radians,
/// then R^T t, the camera's centre in axes that turn with the camera (right, up, towards the
/// camera). A change of only the angles is an orbit around the head at constant distance.
[[nodiscard]] Tensor orbit_parameters(std::span<const Pose> poses, DType dtype = DType::float32);
/// Those of the cameras' poses.
[[nodiscard]] Tensor orbit_parameters(std::span<const Camera> cameras, DType dtype);
/// The cameras at the poses of such parameters, (B, 6), with their own intrinsics.
[[nodiscard]] std::vector<Camera> cameras_at(const Tensor& parameters, std::vector<Camera> cameras);
/// Row `index` of such parameters as a pose.
[[nodiscard]] Pose pose_from_orbit(const Tensor& parameters, std::int64_t index);

/// The sample points (B, R * N, 3) of rays as a differentiable function of orbit parameters (B, 6).
/// Of `cameras` only the intrinsics are used. depths (B, R, N) are those of sample_rays and count
/// as constants, since the positions of samples on a ray do not change the integral along it.
/// Throws ShapeError for extents that do not match.
[[nodiscard]] Variable tracked_points(const Variable& orbits, const std::vector<Camera>& cameras,
                                      const RaySampling& sampling, const Tensor& depths);

}  // namespace stymo
