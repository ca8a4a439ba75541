#pragma once

#include "core/kernels/conv_geometry.h"

/// Depthwise convolutions: each group has one input and one output channel. The loop over channels
/// is innermost and contiguous. T: float, double.
namespace stymo::kernels {

template <class T>
void depthwise_conv2d(const T* x, const T* weight, const ConvFinish<T>& finish, T* y,
                      const ConvGeometry& g);
template <class T>
void depthwise_conv2d_transpose(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g);
template <class T>
void depthwise_conv2d_weight_grad(const T* dL_dy, const T* x, T* dL_dweight, const ConvGeometry& g);

}  // namespace stymo::kernels
