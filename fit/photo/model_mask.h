#pragma once

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/camera.h"

namespace stymo {

/// The probability (S, S, 1) that a pixel of an aligned crop (S, S, 3) in [0, 1] belongs to the
/// head: the opacity of the model's face for the encoder's codes of the crop, rendered in this
/// pose. It is blurred, because there are few rays; GrabCut finds the edge (grab_cut.h). Throws
/// ValueError for a model without an encoder.
[[nodiscard]] Tensor head_probability(const Model& model, const Tensor& crop, const Pose& pose,
                                      const Intrinsics& intrinsics);

}  // namespace stymo
