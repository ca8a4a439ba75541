#include "nn/realtime/view_range.h"

namespace stymo {

std::vector<Camera> cameras_over(const ViewRange& range, int yaws, int pitches) {
    std::vector<Camera> cameras;
    const auto angle = [](double most, int i, int count) {
        return most * (2.0 * i / (count - 1) - 1.0);
    };
    for (int i = 0; i < yaws; ++i) {
        for (int k = 0; k < pitches; ++k) {
            const CameraConfig& camera = range.camera;
            const Pose pose = pivot_pose(angle(range.yaw, i, yaws), angle(range.pitch, k, pitches),
                                         0.0, camera.distance, camera.pivot_depth);
            cameras.push_back(camera_from_pose(pose, camera.intrinsics));
        }
    }
    return cameras;
}

}  // namespace stymo
