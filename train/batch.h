#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "nn/models/codes.h"
#include "render/camera.h"

namespace stymo {

/// One photo at the training size S, with what is known of it.
struct Face {
    std::string id;
    Tensor image;  ///< (S, S, 3) in [0, 1], unmasked
    Tensor mask;   ///< (S, S, 1) in [0, 1], 1 on the head; 1 everywhere if there is none
    Pose pose;     ///< frontal if there is none
    Intrinsics intrinsics;
    std::vector<float> code;  ///< the 306 numbers of a morphable model's fit, or none
    bool has_mask = false;
    bool has_pose = false;
    bool has_code = false;
};

/// The face as a mirror shows it. Its code is gone: the codes of the mirrored face are not known.
[[nodiscard]] Face mirrored(const Face& face);

/// Several faces as the networks and the losses take them.
struct TrainingBatch {
    std::vector<std::string> ids;
    Tensor input;                 ///< (B, S, S, 3) in [-1, 1], unmasked: what the encoder sees
    std::vector<Tensor> targets;  ///< (B, s, s, 3) in [-1, 1] for s = 64, 128, ..., S: the head on black (-1)
    Tensor mask;                  ///< (B, S, S, 1) in [0, 1]
    Tensor mask_32;               ///< (B, 32, 32, 1) in [0, 1]: one value for each ray
    std::vector<Camera> cameras;
    std::array<Tensor, 4> codes;  ///< (B, size) of each group in the order of `code_names`, zeros where there is no code
    Tensor code_present;          ///< (B), 1 where there is a code

    /// Whether any face of the batch has a code.
    [[nodiscard]] bool has_codes() const;
};

/// Each image is multiplied by its mask in [0, 1], then mapped to [-1, 1], then shrunk by antialiased bicubic
/// resampling and clipped to the range again. Throws ValueError for no faces, ShapeError for faces of different sides or a side
/// that is not 64, 128, 256, ...
[[nodiscard]] TrainingBatch make_batch(std::span<const Face> faces);

}  // namespace stymo
