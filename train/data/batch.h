#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "nn/models/face_batch.h"
#include "render/camera.h"

namespace stymo {

/// One photo at the training size S, with what is known of it.
struct Face {
    std::string id;
    Tensor image;  ///< (S, S, 3) in [0, 1], unmasked
    Tensor mask;   ///< (S, S, 1) in [0, 1], 1 on the head; 1 everywhere if there is none
    Pose pose;     ///< frontal if there is none
    Intrinsics intrinsics;
    std::vector<float> code;  ///< the 306 elements of a morphable model's fit, or none
    bool has_mask = false;
    bool has_pose = false;
    bool has_code = false;
};

/// The face as a mirror shows it. Its code is gone: the codes of the mirrored face are not known.
[[nodiscard]] Face mirrored(const Face& face);

/// Each image is multiplied by its mask in [0, 1], then mapped to [-1, 1], then shrunk by
/// antialiased bicubic resampling and clipped to the range again. The targets' sides are those of
/// the model's ladder, which begins with `smallest_target`. Throws ValueError for no faces,
/// ShapeError for faces of different sides or a side that is none of the ladder's.
[[nodiscard]] FaceBatch make_batch(std::span<const Face> faces, std::int64_t smallest_target = 64);

}  // namespace stymo
