#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "render/camera.h"

namespace stymo {

/// Cameras in the forms that other programs write (docs/conventions.md).

/// [R | c; 0 0 0 1]: columns are the camera's right, down and forward in world axes, and its
/// centre.
[[nodiscard]] Eigen::Matrix4d world_from_camera_matrix(const Camera& camera);
/// [R^T | -R^T c], which takes a homogeneous world point to the camera's axes.
[[nodiscard]] Eigen::Matrix<double, 3, 4> camera_from_world_matrix(const Camera& camera);
/// The camera of such a matrix. Throws ValueError unless it is a rotation and a translation.
[[nodiscard]] Camera camera_from_matrix(const Eigen::Matrix4d& world_from_camera,
                                        const Intrinsics& intrinsics);
[[nodiscard]] Camera camera_from_matrix(const Eigen::Matrix<double, 3, 4>& camera_from_world,
                                        const Intrinsics& intrinsics);

/// The camera moved along its optical axis so that a focal length of `focal` shows the origin of
/// the world as large as before.
[[nodiscard]] Camera with_focal(Camera camera, double focal);

/// Focal length of EG3D's cameras of FFHQ (NVlabs/eg3d, dataset_preprocessing/ffhq).
inline constexpr double eg3d_focal = 4.2647;
/// EG3D's unit of length in ours. Its frontal camera at 2.7 thereby sees what ours sees from 5.3
/// with a focal length of 2.03.
inline constexpr double eg3d_unit = 5.3 / 2.03 * eg3d_focal / 2.7;

using Eg3dLabel = std::array<double, 25>;

/// EG3D's label of the camera: 4x4 world from camera, row-major, in its units, then the 3x3 matrix
/// of normalised intrinsics with EG3D's own focal length (with_focal).
[[nodiscard]] Eg3dLabel eg3d_label(const Camera& camera);
/// The camera of a label, in our units, with the label's intrinsics. Throws ValueError for numbers
/// that are not a label.
[[nodiscard]] Camera camera_from_eg3d(std::span<const double, 25> label);

}  // namespace stymo
