#pragma once

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// leaky_relu(product + bias, slope); an undefined bias counts as 0.
[[nodiscard]] Tensor conv2d(const Tensor& x, const Tensor& weight, const Tensor& bias, double slope,
                            const Shape& output_shape, const Conv2dOptions& options);
[[nodiscard]] Tensor conv2d_transpose(const Tensor& dL_dy, const Tensor& weight,
                                      const Shape& input_shape, const Conv2dOptions& options);
/// conv2d_transpose(leaky_gate(dL_dy, y, slope, 1), weight).
[[nodiscard]] Tensor conv2d_gated_transpose(const Tensor& dL_dy, const Tensor& y, double slope,
                                            const Tensor& weight, const Shape& input_shape,
                                            const Conv2dOptions& options);
[[nodiscard]] Tensor conv2d_weight_grad(const Tensor& dL_dy, const Tensor& x,
                                        const Shape& weight_shape, const Conv2dOptions& options);

}  // namespace stymo::kernels
