#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

/// x / (|x| + epsilon), the norm over the last axis; where it is 0 it counts as 1.
[[nodiscard]] Tensor unit_channels(const Tensor& x, double epsilon);
/// From the gradient of that to the gradient of x; where the norm is 0 it is a constant.
[[nodiscard]] Tensor unit_channels_gradient(const Tensor& dL_dy, const Tensor& x, double epsilon);
/// (batch, height, width, channels) twice -> (batch, 1, 1, channels): the mean over the pixels of
/// (a - b)^2.
[[nodiscard]] Tensor mean_squared_difference(const Tensor& a, const Tensor& b);

}  // namespace stymo::kernels
