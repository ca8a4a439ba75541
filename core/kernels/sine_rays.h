#pragma once

#include "core/ops/sine_rays.h"

namespace stymo::kernels {

/// The forward pass of core/ops/sine_rays.h. Shapes are checked by the op.
[[nodiscard]] Tensor sine_rays(const RayPoints& rays, const SineNetworkOf<Tensor>& network);

/// Gradients of all parts of the network, in their shapes; those of the weights stay undefined unless wanted. Sums are grouped by
/// runs of rays, whatever the number of threads.
[[nodiscard]] SineNetworkOf<Tensor> sine_rays_gradient(const RayPoints& rays, const SineNetworkOf<Tensor>& network,
                                                       const Tensor& dL_dy, bool with_weights);

}  // namespace stymo::kernels
