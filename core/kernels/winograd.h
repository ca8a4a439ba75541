#pragma once

#include "core/kernels/conv_geometry.h"

/// 3x3 convolutions of stride 1 in float32 by Winograd's minimal filtering F(4x4, 3x3) (Lavin and
/// Gray, "Fast Algorithms for Convolutional Neural Networks", 2016): a quarter of the
/// multiplications of the direct form, as 36 independent matrix products for each block of tiles.
/// The interpolation points are 0, +-a, +-b and infinity.
namespace stymo::kernels {

/// Whether these functions support the convolution: 3x3, stride 1, one group, channels in multiples
/// of 16.
[[nodiscard]] bool winograd_serves(const ConvGeometry& g);
/// Whether they are also faster than the direct form: there are enough output pixels to compensate
/// for the transformation of the filters.
[[nodiscard]] bool winograd_pays(const ConvGeometry& g);

/// The three convolutions of core/ops/conv.h on contiguous arrays. Results do not depend on the
/// number of threads.
void winograd_conv2d(const float* x, const float* weight, const ConvFinish<float>& finish, float* y,
                     const ConvGeometry& g);
void winograd_conv2d_transpose(const float* dL_dy, const ConvGate<float>& gate, const float* weight,
                               float* dL_dx, const ConvGeometry& g);
void winograd_conv2d_weight_grad(const float* dL_dy, const float* x, float* dL_dweight,
                                 const ConvGeometry& g);

}  // namespace stymo::kernels
