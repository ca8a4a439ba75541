#pragma once

#include "core/autograd/variable.h"
#include "core/op_options.h"

namespace stymo {

/// Matrix product over the last two axes. Both operands have rank 2 or both have rank 3. In rank 3
/// the leading extents are equal, or one of them is 1 and that matrix is used for every matrix of
/// the other operand. Throws ShapeError for other shapes, TypeError for different element types.
[[nodiscard]] Variable matmul(const Variable& a, const Variable& b, MatmulOptions options = {});

/// The pointwise layer activation(x W^T + bias): x (batch, rows, in), weight (batch or 1, out, in),
/// bias (out) or undefined. Leaky ReLU has slope 0.2 and gain sqrt(2), as in StyleGAN2. A fused
/// kernel; `linear_reference` is its reference implementation and provides second derivatives.
/// Throws ShapeError for other shapes, TypeError for different element types.
[[nodiscard]] Variable linear(const Variable& x, const Variable& weight, const Variable& bias,
                              Activation activation = Activation::none);
/// The same composed from matmul, add and the activation.
[[nodiscard]] Variable linear_reference(const Variable& x, const Variable& weight,
                                        const Variable& bias, Activation activation);

}  // namespace stymo
