#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "render/camera.h"

namespace stymo {

/// Conversion of cameras from and to the matrices of other programs (docs/conventions.md).

/// [R | c; 0 0 0 1]: the columns are the camera's right, down and forward in world axes, and its
/// centre.
[[nodiscard]] Eigen::Matrix4d world_from_camera_matrix(const Camera& camera);
/// [R^T | -R^T c], which maps a homogeneous world point to the camera's axes.
[[nodiscard]] Eigen::Matrix<double, 3, 4> camera_from_world_matrix(const Camera& camera);
/// The camera of such a matrix. Throws ValueError unless the matrix consists of a rotation and a
/// translation.
[[nodiscard]] Camera camera_from_matrix(const Eigen::Matrix4d& world_from_camera,
                                        const Intrinsics& intrinsics);
[[nodiscard]] Camera camera_from_matrix(const Eigen::Matrix<double, 3, 4>& camera_from_world,
                                        const Intrinsics& intrinsics);

/// The camera with another focal length, moved along its optical axis so that objects at the origin
/// of the world keep their size in the image.
[[nodiscard]] Camera with_focal(Camera camera, double focal);

/// Focal length of EG3D's cameras of FFHQ (NVlabs/eg3d, dataset_preprocessing/ffhq).
inline constexpr double eg3d_focal = 4.2647;
/// EG3D's unit of length in our units. With it EG3D's frontal camera at distance 2.7 sees the same
/// as ours at distance 5.3 with a focal length of 2.03.
inline constexpr double eg3d_unit = 5.3 / 2.03 * eg3d_focal / 2.7;

using Eg3dLabel = std::array<double, 25>;

/// EG3D's label of the camera: 4x4 world from camera, row-major, in EG3D's units, then the 3x3
/// matrix of normalised intrinsics with EG3D's focal length (see with_focal).
[[nodiscard]] Eg3dLabel eg3d_label(const Camera& camera);
/// The camera of a label, in our units, with the label's intrinsics. Throws ValueError for numbers
/// that are not a label.
[[nodiscard]] Camera camera_from_eg3d(std::span<const double, 25> label);

}  // namespace stymo
