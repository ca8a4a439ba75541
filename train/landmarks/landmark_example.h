#pragma once

#include "core/tensor.h"
#include "nn/pretrained/face_square.h"

namespace stymo {

/// A face whose landmarks are known.
struct LandmarkExample {
    /// (height, width, 3) in [0, 1], or (height, width, 4) for a face without background: colours
    /// premultiplied by the coverage, then the coverage.
    Tensor image;
    FacePoints points;
    /// Weight of each point in the loss.
    std::array<float, 68> weights{};
};

}  // namespace stymo
