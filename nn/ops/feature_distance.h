#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// What LPIPS adds to a norm before it divides by it.
inline constexpr double feature_epsilon = 1e-10;

/// Mean over the pixels of sum_c weight_c (unit_channels(x, feature_epsilon)_c - target_c)^2, (B):
/// x and target (B, h, w, C), weight (C). Keeps nothing but x and target; with create_graph the
/// gradients are those of the composition. Throws ShapeError for extents that differ.
[[nodiscard]] Variable feature_distance(const Variable& x, const Tensor& target,
                                        const Tensor& weight);
/// The same composed of ops: its oracle.
[[nodiscard]] Variable feature_distance_reference(const Variable& x, const Tensor& target,
                                                  const Tensor& weight);

}  // namespace stymo
