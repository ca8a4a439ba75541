#include "nn/realtime/view_range.h"

#include "nn/realtime/view.h"

namespace stymo {

std::vector<Camera> cameras_over(const ViewRange& range, int yaws, int pitches) {
    std::vector<Camera> cameras;
    const auto angle = [](double most, int i, int count) {
        return most * (2.0 * i / (count - 1) - 1.0);
    };
    for (int i = 0; i < yaws; ++i) {
        for (int k = 0; k < pitches; ++k) {
            const double turning_z = range.around_head ? head_middle : range.camera.pivot_depth;
            cameras.push_back(turned_camera(range.camera, turning_z, angle(range.yaw, i, yaws),
                                            angle(range.pitch, k, pitches), 0.0));
        }
    }
    return cameras;
}

}  // namespace stymo
