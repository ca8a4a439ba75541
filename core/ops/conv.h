#pragma once

#include "core/autograd/variable.h"
#include "core/op_options.h"

/// Two-dimensional cross-correlation and its two adjoints, and pooling, of images (batch, height,
/// width, channels). Derivatives of any order exist. All ops throw ShapeError for shapes that do
/// not match, ValueError for invalid options and TypeError for different element types.
namespace stymo {

/// x (batch, height, width, in), weight (out, kernel height, kernel width, in / groups) -> (batch,
/// height', width', out) with height' = floor((height + 2 padding - kernel height) / stride) + 1.
[[nodiscard]] Variable conv2d(const Variable& x, const Variable& weight,
                              const Conv2dOptions& options = {});
/// leaky_relu(conv2d(x, weight) + bias, slope), with a bias (out) or an undefined one. Slope 0 is
/// ReLU, slope 1 no activation; ValueError for a negative slope. Bias and activation are applied
/// while a result is in cache. The composition of ops is the reference implementation.
[[nodiscard]] Variable conv2d(const Variable& x, const Variable& weight, const Variable& bias,
                              double slope, const Conv2dOptions& options = {});
/// Adjoint of conv2d with respect to x: maps the output's gradient to the gradient of an input of
/// `input_shape`.
[[nodiscard]] Variable conv2d_transpose(const Variable& dL_dy, const Variable& weight,
                                        const Shape& input_shape,
                                        const Conv2dOptions& options = {});
/// Adjoint of conv2d with respect to the weight: maps the output's gradient to the gradient of a
/// weight of `weight_shape`.
[[nodiscard]] Variable conv2d_weight_grad(const Variable& dL_dy, const Variable& x,
                                          const Shape& weight_shape,
                                          const Conv2dOptions& options = {});

/// Largest element of each window and channel; at a tie the gradient goes to the first one in
/// row-major order. No padding. (batch, h, w, c) -> (batch, h', w', c) with h' = (h - kernel) /
/// stride + 1, rounded down, or up with ceil_mode. Throws ValueError for invalid options or a
/// kernel above 16, ShapeError for another rank or an image smaller than a window.
[[nodiscard]] Variable max_pool2d(const Variable& x, const MaxPoolOptions& options = {});

}  // namespace stymo
