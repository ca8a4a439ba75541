#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/autograd/variable.h"
#include "render/camera.h"

/// The unknowns of the fit as one vector. Not part of the public interface.
namespace stymo::morphable {

/// The state: yaw, pitch, roll and the head's origin in the camera's axes (x right, y down, z
/// forward), then the codes.
inline constexpr std::size_t pose_size = 6;
inline constexpr std::size_t identity_begin = pose_size;
inline constexpr std::size_t expression_begin = identity_begin + 100;
inline constexpr std::size_t texture_begin = expression_begin + 79;
inline constexpr std::size_t light_begin = texture_begin + 100;
inline constexpr std::size_t state_size = light_begin + 27;
inline constexpr std::size_t shape_size = texture_begin - identity_begin;

using State = std::vector<double>;

[[nodiscard]] Pose pose_of(std::span<const double> state);
[[nodiscard]] std::vector<float> code_of(std::span<const double> state, std::size_t begin,
                                         std::size_t size);

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
