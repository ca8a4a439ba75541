#pragma once

#include "core/autograd/variable.h"

/// Activations, in forms that do not overflow for any finite argument.
namespace stymo {

[[nodiscard]] Variable sigmoid(const Variable& x);
[[nodiscard]] Variable tanh(const Variable& x);
/// log(1 + exp(x)), computed as max(x, 0) + log1p(exp(-|x|)).
[[nodiscard]] Variable softplus(const Variable& x);
/// Subgradient `slope` at 0. Throws ValueError for a negative slope.
[[nodiscard]] Variable leaky_relu(const Variable& x, double slope);
/// gain * x where sign > 0, else gain * slope * x: the derivative of leaky ReLU multiplied by x.
/// Throws ShapeError unless both have the same shape.
[[nodiscard]] Variable leaky_gate(const Variable& x, const Tensor& sign, double slope,
                                  double gain = 1.0);
[[nodiscard]] inline Variable relu(const Variable& x) {
    return leaky_relu(x, 0.0);
}
/// Leaky ReLU with one learnt slope for each channel (last axis).
[[nodiscard]] Variable prelu(const Variable& x, const Variable& slope);
/// Binary cross-entropy of a logit against a target t in [0, 1]: (1 - t) softplus(x) + t
/// softplus(-x), elementwise.
[[nodiscard]] Variable binary_cross_entropy_with_logits(const Variable& logit,
                                                        const Variable& target);

}  // namespace stymo
