#pragma once

#include "core/kernels/conv_geometry.h"

/// Convolutions of any geometry as matrix products of unfolded pixels (im2col) and packed filters.
/// T: float, double.
namespace stymo::kernels {

/// The three convolutions of core/ops/conv.h on contiguous arrays. Results do not depend on the
/// number of threads.
template <class T>
void direct_conv2d(const T* x, const T* weight, const ConvFinish<T>& finish, T* y,
                   const ConvGeometry& g);
template <class T>
void direct_conv2d_transpose(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g);
template <class T>
void direct_conv2d_weight_grad(const T* dL_dy, const T* x, T* dL_dweight, const ConvGeometry& g);

}  // namespace stymo::kernels
