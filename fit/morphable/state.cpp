#include "fit/morphable/state.h"

#include "core/ops/ops.h"

namespace stymo::morphable {

Pose pose_of(std::span<const double> state) {
    Pose pose{state[0], state[1], state[2]};
    pose.translation = -camera_from_pose(pose, {}).world_from_camera *
                       Eigen::Map<const Eigen::Vector3d>(&state[3]);
    return pose;
}

std::vector<float> code_of(std::span<const double> state, std::size_t begin, std::size_t size) {
    std::vector<float> code;
    for (const double value : state.subspan(begin, size)) code.push_back(static_cast<float>(value));
    return code;
}

Variable column(const Variable& x, std::int64_t index) {
    return slice(x, 1, index, index + 1);
}

Variable camera_directions(const Variable& poses, const Variable& directions) {
    const Variable cos_pose = cos(slice(poses, 1, 0, 3));
    const Variable sin_pose = sin(slice(poses, 1, 0, 3));
    const Variable cos_yaw = column(cos_pose, 0), sin_yaw = column(sin_pose, 0);
    const Variable cos_pitch = column(cos_pose, 1), sin_pitch = column(sin_pose, 1);
    const Variable cos_roll = column(cos_pose, 2), sin_roll = column(sin_pose, 2);
    const Variable x = column(directions, 0), y = column(directions, 1), z = column(directions, 2);
    // The transpose of Rz(roll) Ry(yaw) Rx(pitch), factor by factor, then y and z flipped to the
    // camera's.
    const Variable x1 = cos_roll * x + sin_roll * y;
    const Variable y1 = cos_roll * y - sin_roll * x;
    const Variable x2 = cos_yaw * x1 - sin_yaw * z;
    const Variable z2 = sin_yaw * x1 + cos_yaw * z;
    const Variable y3 = cos_pitch * y1 + sin_pitch * z2;
    const Variable z3 = cos_pitch * z2 - sin_pitch * y1;
    return concat({x2, negate(y3), negate(z3)}, 1);
}

Variable camera_points(const Variable& poses, const Variable& points) {
    return camera_directions(poses, points) + slice(poses, 1, 3, 6);
}

Variable image_points(const Variable& camera_points, const Intrinsics& intrinsics) {
    const Variable depth = column(camera_points, 2);
    const Variable x =
        affine(column(camera_points, 0) / depth, intrinsics.focal, intrinsics.center_x);
    const Variable y =
        affine(column(camera_points, 1) / depth, intrinsics.focal, intrinsics.center_y);
    return concat({x, y}, 1);
}

}  // namespace stymo::morphable
