#pragma once

#include <vector>

#include "nn/models/model.h"

namespace stymo {

/// Cameras that see the head turned to either side, and up and down, by up to these angles.
struct ViewRange {
    CameraConfig camera;
    double yaw = 0.53;  ///< radians
    double pitch = 0.2;
};

/// `yaws` times `pitches` of them, evenly spaced, the outermost ones included; both at least 2.
[[nodiscard]] std::vector<Camera> cameras_over(const ViewRange& range, int yaws, int pitches);

}  // namespace stymo
