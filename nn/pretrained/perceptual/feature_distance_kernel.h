#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

/// The forward pass of nn/pretrained/perceptual/feature_distance.h, which checks the shapes.
[[nodiscard]] Tensor feature_distance(const Tensor& x, const Tensor& target, const Tensor& weight,
                                      double epsilon);
/// dL/dx for dL_dy (B).
[[nodiscard]] Tensor feature_distance_gradient(const Tensor& x, const Tensor& target,
                                               const Tensor& weight, double epsilon,
                                               const Tensor& dL_dy);

}  // namespace stymo::kernels
