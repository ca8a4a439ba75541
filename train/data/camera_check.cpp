#include "train/data/camera_check.h"

#include "nn/models/camera_problem.h"

namespace stymo {

CameraCheck camera_check(const DecoderConfig& config, bool with_mirror) {
    return [config, with_mirror](const Pose& pose, const Intrinsics& intrinsics) {
        auto problem = camera_problem(config, camera_from_pose(pose, intrinsics));
        if (problem || !with_mirror) return problem;
        Intrinsics flipped = intrinsics;
        flipped.center_x = 1.0 - intrinsics.center_x;
        return camera_problem(config, camera_from_pose(mirrored(pose), flipped));
    };
}

}  // namespace stymo
