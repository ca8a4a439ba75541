#pragma once

#include "core/ops/feature_distance.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// core/ops/feature_distance.h; shapes are checked by the op.
[[nodiscard]] Tensor feature_distance(const Tensor& x, const Tensor& target, const Tensor& weight);
/// dL/dx for dL_dy (B).
[[nodiscard]] Tensor feature_distance_gradient(const Tensor& x, const Tensor& target, const Tensor& weight, const Tensor& dL_dy);

}  // namespace stymo::kernels
