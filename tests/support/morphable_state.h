#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "fit/morphable/morphable_fit.h"
#include "fit/morphable/state.h"

namespace stymo::test {

/// The first pose_size numbers of a state: the inverse of `morphable::pose_of`.
[[nodiscard]] inline std::array<double, morphable::pose_size> pose_numbers(const Pose& pose) {
    const Eigen::Vector3d head =
        -camera_from_pose(pose, {}).world_from_camera.transpose() * pose.translation;
    return {pose.yaw, pose.pitch, pose.roll, head.x(), head.y(), head.z()};
}

/// The state of a fit: the inverse of `morphable::pose_of` and `morphable::code_of`.
[[nodiscard]] inline morphable::State state_of(const MorphableFit& fit) {
    morphable::State state(morphable::state_size, 0.0);
    std::ranges::copy(pose_numbers(fit.pose), state.begin());
    const auto put = [&](const std::vector<float>& code, std::size_t begin) {
        std::ranges::copy(code, state.begin() + static_cast<std::ptrdiff_t>(begin));
    };
    put(fit.identity, morphable::identity_begin);
    put(fit.expression, morphable::expression_begin);
    put(fit.texture, morphable::texture_begin);
    put(fit.light, morphable::light_begin);
    return state;
}

}  // namespace stymo::test
