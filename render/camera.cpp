#include "render/camera.h"

#include <cmath>

namespace stymo {
namespace {

/// From right, down, forward to right, up, backward, and back.
constexpr Matrix3 camera_axes{{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};

Matrix3 product(const Matrix3& a, const Matrix3& b) {
    Matrix3 result{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            for (std::size_t k = 0; k < 3; ++k) {
                result[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    return result;
}

}  // namespace

Matrix3 rotation_from_angles(double yaw, double pitch, double roll) {
    const double cos_yaw = std::cos(yaw), sin_yaw = std::sin(yaw);
    const double cos_pitch = std::cos(pitch), sin_pitch = std::sin(pitch);
    const double cos_roll = std::cos(roll), sin_roll = std::sin(roll);
    const Matrix3 about_x{{{1, 0, 0}, {0, cos_pitch, -sin_pitch}, {0, sin_pitch, cos_pitch}}};
    const Matrix3 about_y{{{cos_yaw, 0, sin_yaw}, {0, 1, 0}, {-sin_yaw, 0, cos_yaw}}};
    const Matrix3 about_z{{{cos_roll, -sin_roll, 0}, {sin_roll, cos_roll, 0}, {0, 0, 1}}};
    return product(about_z, product(about_y, about_x));
}

Vector3 angles_from_rotation(const Matrix3& rotation) {
    const double cos_yaw = std::hypot(rotation[0][0], rotation[1][0]);
    const double yaw = std::atan2(-rotation[2][0], cos_yaw);
    // Below this the entries that separate pitch from roll are rounding errors of the others.
    constexpr double gimbal_lock = 1e-6;
    if (cos_yaw < gimbal_lock) {
        return {yaw, std::atan2(-rotation[1][2], rotation[1][1]), 0.0};
    }
    return {yaw, std::atan2(rotation[2][1], rotation[2][2]), std::atan2(rotation[1][0], rotation[0][0])};
}

Camera camera_from_pose(const Pose& pose, const Intrinsics& intrinsics) {
    const Matrix3 rotation = rotation_from_angles(pose.yaw, pose.pitch, pose.roll);
    return {intrinsics, product(rotation, camera_axes), pose.translation};
}

Pose pose_from_camera(const Camera& camera) {
    const auto [yaw, pitch, roll] = angles_from_rotation(product(camera.world_from_camera, camera_axes));
    return {yaw, pitch, roll, camera.center};
}

Pose orbit_pose(double yaw, double pitch, double roll, double distance) {
    const Matrix3 rotation = rotation_from_angles(yaw, pitch, roll);
    return {yaw, pitch, roll, {distance * rotation[0][2], distance * rotation[1][2], distance * rotation[2][2]}};
}

Pose pivot_pose(double yaw, double pitch, double roll, double distance, double pivot_depth) {
    Pose pose = orbit_pose(yaw, pitch, roll, distance - pivot_depth);
    pose.translation[2] += pivot_depth;
    return pose;
}

Pose mirrored(const Pose& pose) {
    const auto [x, y, z] = pose.translation;
    return {-pose.yaw, pose.pitch, -pose.roll, {-x, y, z}};
}

Vector3 project(const Camera& camera, const Vector3& world_point) {
    Vector3 camera_point{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        for (std::size_t k = 0; k < 3; ++k) {
            camera_point[axis] += camera.world_from_camera[k][axis] * (world_point[k] - camera.center[k]);
        }
    }
    const auto [x, y, depth] = camera_point;
    const Intrinsics& intrinsics = camera.intrinsics;
    return {intrinsics.focal * x / depth + intrinsics.center_x, intrinsics.focal * y / depth + intrinsics.center_y, depth};
}

}  // namespace stymo
