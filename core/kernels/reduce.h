#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

/// Sum over the axes marked in `reduced` (one flag for each axis), kept with extent 1. Chunks and
/// their order are fixed, so that the result does not depend on the number of threads.
[[nodiscard]] Tensor sum(const Tensor& x, std::uint32_t reduced);
[[nodiscard]] Tensor cumsum(const Tensor& x, int axis, bool exclusive);

/// x / (|x| + epsilon), with the norm over the last axis. A norm of 0 is replaced by 1.
[[nodiscard]] Tensor unit_channels(const Tensor& x, double epsilon);
/// The gradient of x from the gradient of unit_channels. A norm of 0 is treated as a constant.
[[nodiscard]] Tensor unit_channels_gradient(const Tensor& dL_dy, const Tensor& x, double epsilon);
/// The mean of (a - b)^2 over the pixels: a and b (batch, height, width, channels) -> (batch, 1, 1,
/// channels).
[[nodiscard]] Tensor mean_squared_difference(const Tensor& a, const Tensor& b);

}  // namespace stymo::kernels
