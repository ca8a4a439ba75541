#pragma once

#include <vector>

#include "nn/models/model.h"

namespace stymo {

/// A range of cameras: the head is turned by up to `yaw` to either side and by up to `pitch` up and
/// down.
struct ViewRange {
    CameraConfig camera;
    double yaw = 0.53;  ///< radians
    double pitch = 0.2;
    bool around_head = false;  ///< turns around the head's middle, which shows all of it, not the
                               ///< face, which stays larger
};

/// `yaws` times `pitches` cameras of the range, evenly spaced, with the outermost ones. Both
/// numbers are at least 2.
[[nodiscard]] std::vector<Camera> cameras_over(const ViewRange& range, int yaws, int pitches);

}  // namespace stymo
