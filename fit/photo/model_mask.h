#pragma once

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/camera.h"

namespace stymo {

/// The probability of each pixel of an aligned crop (S, S, 3) in [0, 1] to belong to the head, (S,
/// S, 1): the opacity of the face that the model's encoder sees in it, rendered in this pose.
/// Smooth, because there are few rays; GrabCut finds the edge (grab_cut.h). Throws ValueError for a
/// model without an encoder.
[[nodiscard]] Tensor head_probability(const Model& model, const Tensor& crop, const Pose& pose,
                                      const Intrinsics& intrinsics);

}  // namespace stymo
