#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// LPIPS adds this to a norm before dividing by it.
inline constexpr double feature_epsilon = 1e-10;

/// Mean over the pixels of sum_c weight_c (unit_channels(x, feature_epsilon)_c - target_c)^2, (B):
/// x and target (B, h, w, C), weight (C). Saves only x and target. With create_graph the gradients
/// are those of the composition. Throws ShapeError for extents that do not match.
[[nodiscard]] Variable feature_distance(const Variable& x, const Tensor& target,
                                        const Tensor& weight);
/// The same as a composition of ops: the reference implementation.
[[nodiscard]] Variable feature_distance_reference(const Variable& x, const Tensor& target,
                                                  const Tensor& weight);

}  // namespace stymo
