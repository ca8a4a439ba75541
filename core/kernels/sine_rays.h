#pragma once

#include "core/ops/sine_rays.h"

namespace stymo::kernels {

struct SineRaysResult {
    Tensor value;
    Tensor arguments;  ///< (B, layers, R * N, width), each tile's rows from its first sample's on; undefined unless wanted
};

/// The forward pass of core/ops/sine_rays.h. Shapes are checked by the op.
[[nodiscard]] SineRaysResult sine_rays(const RayPoints& rays, const SineNetworkOf<Tensor>& network, bool keep_arguments);

/// Gradients of all parts of the network, in their shapes; those of the weights stay undefined unless wanted. Undefined
/// `arguments` are computed once more. Sums are grouped by runs of rays, whatever the number of threads.
[[nodiscard]] SineNetworkOf<Tensor> sine_rays_gradient(const RayPoints& rays, const SineNetworkOf<Tensor>& network,
                                                       const Tensor& arguments, const Tensor& dL_dy, bool with_weights);

}  // namespace stymo::kernels
