#include "render/camera.h"

#include <Eigen/Geometry>
#include <cmath>

namespace stymo {
namespace {

/// Changes the axes right, down, forward to right, up, backward, and the other way round.
const Eigen::DiagonalMatrix<double, 3> camera_axes(1.0, -1.0, -1.0);

Eigen::Matrix3d rotation_about(const Eigen::Vector3d& axis, double angle) {
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

}  // namespace

Eigen::Matrix3d rotation_from_angles(double yaw, double pitch, double roll) {
    return rotation_about(Eigen::Vector3d::UnitZ(), roll) *
           rotation_about(Eigen::Vector3d::UnitY(), yaw) *
           rotation_about(Eigen::Vector3d::UnitX(), pitch);
}

Eigen::Vector3d angles_from_rotation(const Eigen::Matrix3d& rotation) {
    const double cos_yaw = std::hypot(rotation(0, 0), rotation(1, 0));
    const double yaw = std::atan2(-rotation(2, 0), cos_yaw);
    // Below this the entries that separate pitch from roll are rounding errors of the others.
    constexpr double gimbal_lock = 1e-6;
    if (cos_yaw < gimbal_lock) {
        return {yaw, std::atan2(-rotation(1, 2), rotation(1, 1)), 0.0};
    }
    return {yaw, std::atan2(rotation(2, 1), rotation(2, 2)),
            std::atan2(rotation(1, 0), rotation(0, 0))};
}

Camera camera_from_pose(const Pose& pose, const Intrinsics& intrinsics) {
    const Eigen::Matrix3d rotation = rotation_from_angles(pose.yaw, pose.pitch, pose.roll);
    return {intrinsics, rotation * camera_axes, pose.translation};
}

Pose pose_from_camera(const Camera& camera) {
    const Eigen::Vector3d angles = angles_from_rotation(camera.world_from_camera * camera_axes);
    return {angles[0], angles[1], angles[2], camera.center};
}

Pose orbit_pose(double yaw, double pitch, double roll, double distance) {
    return {yaw, pitch, roll, distance * rotation_from_angles(yaw, pitch, roll).col(2)};
}

Pose pivot_pose(double yaw, double pitch, double roll, double distance, double pivot_depth) {
    Pose pose = orbit_pose(yaw, pitch, roll, distance - pivot_depth);
    pose.translation[2] += pivot_depth;
    return pose;
}

Pose mirrored(const Pose& pose) {
    const Eigen::Vector3d& center = pose.translation;
    return {-pose.yaw, pose.pitch, -pose.roll, {-center.x(), center.y(), center.z()}};
}

Eigen::Vector3d project(const Camera& camera, const Eigen::Vector3d& world_point) {
    const Eigen::Vector3d point =
        camera.world_from_camera.transpose() * (world_point - camera.center);
    const Intrinsics& intrinsics = camera.intrinsics;
    return {intrinsics.focal * point.x() / point.z() + intrinsics.center_x,
            intrinsics.focal * point.y() / point.z() + intrinsics.center_y, point.z()};
}

}  // namespace stymo
