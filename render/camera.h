#pragma once

#include <Eigen/Core>

namespace stymo {

/// Intrinsics in units of the image side, shared by all images of a data set
/// (docs/conventions.md).
struct Intrinsics {
    double focal = 2.03;
    double center_x = 0.5;
    double center_y = 0.5;

    bool operator==(const Intrinsics&) const = default;
};

/// The paper's p in R^6. World axes: x to the image's right, y up, z out of the face towards the
/// camera; one unit is about a decimetre. Angles in radians. R = Rz(roll) Ry(yaw) Rx(pitch) turns
/// the camera around the head; `translation` is the camera's centre in world coordinates.
struct Pose {
    double yaw = 0.0;
    double pitch = 0.0;
    double roll = 0.0;
    Eigen::Vector3d translation{0.0, 0.0, 5.3};
};

/// Metres of a world unit, for files whose units are metres.
inline constexpr float metres = 0.1F;

/// A camera looking at the head along its own z axis: OpenCV axes, x right, y down, z forward.
struct Camera {
    Intrinsics intrinsics;
    /// A rotation: columns are the camera's right, down and forward in world axes.
    Eigen::Matrix3d world_from_camera = Eigen::Matrix3d::Identity();
    Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< in world coordinates

    bool operator==(const Camera&) const = default;
};

[[nodiscard]] Eigen::Matrix3d rotation_from_angles(double yaw, double pitch, double roll);
/// Inverse of rotation_from_angles as (yaw, pitch, roll); at gimbal lock roll is 0.
[[nodiscard]] Eigen::Vector3d angles_from_rotation(const Eigen::Matrix3d& rotation);

/// world_from_camera = R diag(1, -1, -1), centre = translation.
[[nodiscard]] Camera camera_from_pose(const Pose& pose, const Intrinsics& intrinsics);
/// Inverse of camera_from_pose.
[[nodiscard]] Pose pose_from_camera(const Camera& camera);
/// The pose that sees the head turned by these angles from `distance`: translation = R (0, 0,
/// distance).
[[nodiscard]] Pose orbit_pose(double yaw, double pitch, double roll, double distance);
/// The pose that keeps the point (0, 0, pivot_depth) of the face in the middle of the image, as
/// FFHQ's alignment does, and is orbit_pose for a frontal view: translation = (0, 0, pivot_depth) +
/// R (0, 0, distance - pivot_depth).
[[nodiscard]] Pose pivot_pose(double yaw, double pitch, double roll, double distance,
                              double pivot_depth);
/// Mirror image of a pose: yaw, roll and the x of the translation change sign.
[[nodiscard]] Pose mirrored(const Pose& pose);
/// World point -> image coordinates in units of the image side (x right, y down) and depth along
/// the optical axis.
[[nodiscard]] Eigen::Vector3d project(const Camera& camera, const Eigen::Vector3d& world_point);

}  // namespace stymo
