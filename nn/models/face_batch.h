#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/camera.h"

namespace stymo {

/// Photos of B faces as the networks and the losses take them, in training and in fitting alike.
/// Fitting reads the first three members, and the codes of a model without an encoder.
struct FaceBatch {
    Tensor input;  ///< (B, S, S, 3) in [-1, 1], unmasked: what the encoder sees
    /// (B, R, R, 3) in [-1, 1] for each side R that the model renders, in ascending order: the head
    /// on black (-1).
    std::vector<Tensor> targets;
    std::vector<Camera> cameras;
    std::vector<std::string> ids{};
    Tensor mask{};      ///< (B, S, S, 1) in [0, 1]
    Tensor ray_mask{};  ///< (B, R, R, 1) in [0, 1] for half the smallest target's side R: one value
                        ///< for each ray
    std::array<Tensor, 4> codes{};  ///< (B, size) of each group in the order of `code_names`, zeros
                                    ///< where a face has no code
    Tensor code_present{};          ///< (B), 1 where there is a code; undefined: nowhere

    /// Whether any face of the batch has a code.
    [[nodiscard]] bool has_codes() const;
};

/// Codes of the batch's faces in Z, before any fitting: the encoder's, or the data's where the
/// model has no encoder. Throws ValueError naming the first face whose code is needed and missing.
[[nodiscard]] Codes face_codes(const Model& model, const FaceBatch& batch);

}  // namespace stymo
