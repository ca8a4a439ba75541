#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

[[nodiscard]] Tensor add(const Tensor& a, const Tensor& b);
[[nodiscard]] Tensor subtract(const Tensor& a, const Tensor& b);
[[nodiscard]] Tensor multiply(const Tensor& a, const Tensor& b);
[[nodiscard]] Tensor divide(const Tensor& a, const Tensor& b);
[[nodiscard]] Tensor maximum(const Tensor& a, const Tensor& b);
[[nodiscard]] Tensor minimum(const Tensor& a, const Tensor& b);
/// 1 where maximum or minimum is the first operand, else 0.
[[nodiscard]] Tensor takes_maximum(const Tensor& a, const Tensor& b);
[[nodiscard]] Tensor takes_minimum(const Tensor& a, const Tensor& b);

[[nodiscard]] Tensor affine(const Tensor& x, double factor, double offset);
[[nodiscard]] Tensor exp(const Tensor& x);
[[nodiscard]] Tensor log(const Tensor& x);
[[nodiscard]] Tensor sin(const Tensor& x);
[[nodiscard]] Tensor cos(const Tensor& x);
[[nodiscard]] Tensor sqrt(const Tensor& x);
[[nodiscard]] Tensor square(const Tensor& x);
[[nodiscard]] Tensor abs(const Tensor& x);
[[nodiscard]] Tensor sign(const Tensor& x);
[[nodiscard]] Tensor clamp(const Tensor& x, double low, double high);
/// x where `selector` is in [low, high], else 0.
[[nodiscard]] Tensor where_within(const Tensor& x, const Tensor& selector, double low, double high);
/// a where `condition` is not 0, else b; all three have one shape and type. A NaN or an infinity
/// that is not selected has no effect.
[[nodiscard]] Tensor select(const Tensor& condition, const Tensor& a, const Tensor& b);
/// 1 where x is not 0, else 0.
[[nodiscard]] Tensor nonzero(const Tensor& x);

[[nodiscard]] Tensor sigmoid(const Tensor& x);
[[nodiscard]] Tensor tanh(const Tensor& x);
[[nodiscard]] Tensor softplus(const Tensor& x);
[[nodiscard]] Tensor leaky_relu(const Tensor& x, double slope);
/// gain * x where sign > 0, else gain * slope * x.
[[nodiscard]] Tensor leaky_gate(const Tensor& x, const Tensor& sign, double slope, double gain);
/// x where x > 0, else slope * x; the slope is broadcast.
[[nodiscard]] Tensor prelu(const Tensor& x, const Tensor& slope);
/// 1 where x > 0, else `slope`.
[[nodiscard]] Tensor leaky_slope(const Tensor& x, double slope);

/// x repeated to `shape`.
[[nodiscard]] Tensor broadcast_to(const Tensor& x, const Shape& shape);

}  // namespace stymo::kernels
