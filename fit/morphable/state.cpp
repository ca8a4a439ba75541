#include "fit/morphable/state.h"

#include <algorithm>

namespace stymo::morphable {

Pose pose_of(std::span<const double> state) {
    Pose pose{state[0], state[1], state[2]};
    pose.translation = -camera_from_pose(pose, {}).world_from_camera *
                       Eigen::Map<const Eigen::Vector3d>(&state[3]);
    return pose;
}

std::array<double, pose_size> pose_numbers(const Pose& pose) {
    const Eigen::Vector3d head =
        -camera_from_pose(pose, {}).world_from_camera.transpose() * pose.translation;
    return {pose.yaw, pose.pitch, pose.roll, head.x(), head.y(), head.z()};
}

std::vector<float> code_of(std::span<const double> state, std::size_t begin, std::size_t size) {
    std::vector<float> code;
    for (const double value : state.subspan(begin, size)) code.push_back(static_cast<float>(value));
    return code;
}

State state_of(const MorphableFit& fit) {
    State state(state_size, 0.0);
    std::ranges::copy(pose_numbers(fit.pose), state.begin());
    const auto put = [&](const std::vector<float>& code, std::size_t begin) {
        std::ranges::copy(code, state.begin() + static_cast<std::ptrdiff_t>(begin));
    };
    put(fit.identity, identity_begin);
    put(fit.expression, expression_begin);
    put(fit.texture, texture_begin);
    put(fit.light, light_begin);
    return state;
}

}  // namespace stymo::morphable
