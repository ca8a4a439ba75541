#include "fit/morphable/state.h"

#include <algorithm>

namespace stymo::morphable {

Pose pose_of(std::span<const double> state) {
    Pose pose{state[0], state[1], state[2], {}};
    const Matrix3 world_from_camera = camera_from_pose(pose, {}).world_from_camera;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        double center = 0.0;
        for (std::size_t k = 0; k < 3; ++k) center -= world_from_camera[axis][k] * state[3 + k];
        pose.translation[axis] = center;
    }
    return pose;
}

std::array<double, pose_size> pose_numbers(const Pose& pose) {
    std::array<double, pose_size> numbers{pose.yaw, pose.pitch, pose.roll};
    const Matrix3 world_from_camera = camera_from_pose(pose, {}).world_from_camera;
    for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t axis = 0; axis < 3; ++axis) numbers[3 + k] -= world_from_camera[axis][k] * pose.translation[axis];
    }
    return numbers;
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
