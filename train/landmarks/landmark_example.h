#pragma once

#include "core/tensor.h"
#include "nn/models/face_square.h"

namespace stymo {

/// A face whose landmarks are known.
struct LandmarkExample {
    /// (height, width, 3), or 4 with the coverage of a face in front of nothing, whose colours are
    /// multiplied by it. In [0, 1].
    Tensor image;
    FacePoints points;
    /// How much each point counts.
    std::array<float, 68> weights{};
};

}  // namespace stymo
