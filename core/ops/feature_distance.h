#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// x / (|x| + 1e-10) over the last axis, the channels. A vector of zeros has no direction: its norm counts as the constant 1,
/// which keeps the value and leaves out the derivative of a root at 0.
[[nodiscard]] Variable normalise_channels(const Variable& x);

/// Mean over the pixels of sum_c weight_c (normalise_channels(x)_c - target_c)^2, (B): x and target (B, h, w, C), weight (C).
/// Keeps nothing but x and target; with create_graph the gradients are those of the composition. Throws ShapeError for extents
/// that differ.
[[nodiscard]] Variable feature_distance(const Variable& x, const Tensor& target, const Tensor& weight);
/// The same composed of ops: its oracle.
[[nodiscard]] Variable feature_distance_reference(const Variable& x, const Tensor& target, const Tensor& weight);

}  // namespace stymo
