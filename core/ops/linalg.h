#pragma once

#include "core/autograd/variable.h"
#include "core/op_options.h"

namespace stymo {

/// Matrix product of the last two axes. Both rank 2, or both rank 3 with equal leading extents, or
/// one of them with leading extent 1 that serves every matrix of the other.
[[nodiscard]] Variable matmul(const Variable& a, const Variable& b, MatmulOptions options = {});

/// activation(x W^T + bias), the pointwise layer: x (batch, rows, in), weight (batch or 1, out,
/// in), bias (out) or undefined. Leaky ReLU has slope 0.2 and gain sqrt(2), as in StyleGAN2. A
/// fused kernel; `linear_reference` is its reference implementation and provides second
/// derivatives.
[[nodiscard]] Variable linear(const Variable& x, const Variable& weight, const Variable& bias,
                              Activation activation = Activation::none);
/// The same composed from matmul, add and the activation.
[[nodiscard]] Variable linear_reference(const Variable& x, const Variable& weight,
                                        const Variable& bias, Activation activation);

}  // namespace stymo
