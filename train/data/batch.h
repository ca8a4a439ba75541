#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "nn/models/face_batch.h"
#include "render/camera.h"

namespace stymo {

/// One photo at the training size S, with its data.
struct Face {
    std::string id;
    Tensor image;  ///< (S, S, 3) in [0, 1], unmasked
    Tensor mask;   ///< (S, S, 1) in [0, 1], 1 on the head; 1 everywhere if there is none
    Pose pose;     ///< frontal if there is none
    Intrinsics intrinsics;
    std::vector<float> code;  ///< the 306 elements of a morphable model's fit, or empty
    bool is_mirrored = false;
    bool has_mask = false;
    bool has_pose = false;
    bool has_code = false;
};

/// The mirror image of a face. It has no code, because the code of a mirrored face is unknown.
[[nodiscard]] Face mirrored(const Face& face);

/// Makes a batch. For the targets each image is multiplied by its mask, mapped to [-1, 1],
/// downsampled by antialiased bicubic resampling and clipped to [-1, 1]. The targets' sides are
/// `smallest_target` doubled up to the faces' side. Throws ValueError for no faces, ShapeError for
/// faces of different sides or a side that doubling does not reach.
[[nodiscard]] FaceBatch make_batch(std::span<const Face> faces, std::int64_t smallest_target = 64);

}  // namespace stymo
