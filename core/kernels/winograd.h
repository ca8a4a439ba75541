#pragma once

#include "core/kernels/conv_geometry.h"

/// 3x3 convolutions of stride 1 in float32 by Winograd's minimal filtering F(4x4, 3x3) (Lavin and
/// Gray, "Fast Algorithms for Convolutional Neural Networks", 2016): a quarter of the direct form's
/// products, 36 independent matrix products for each block of tiles. Interpolation points 0, +-a,
/// +-b and infinity.
namespace stymo::kernels {

/// True where these functions can serve: 3x3, stride 1, one group, channels in multiples of 16.
[[nodiscard]] bool winograd_serves(const ConvGeometry& g);
/// True where they are also faster than the direct form: enough output pixels to pay for the
/// transformed filters.
[[nodiscard]] bool winograd_pays(const ConvGeometry& g);

/// The three convolutions of core/ops/conv.h on contiguous arrays. Bits do not depend on the number
/// of threads.
void winograd_conv2d(const float* x, const float* weight, const ConvFinish<float>& finish, float* y,
                     const ConvGeometry& g);
void winograd_conv2d_transpose(const float* dL_dy, const ConvGate<float>& gate, const float* weight,
                               float* dL_dx, const ConvGeometry& g);
void winograd_conv2d_weight_grad(const float* dL_dy, const float* x, float* dL_dweight,
                                 const ConvGeometry& g);

}  // namespace stymo::kernels
