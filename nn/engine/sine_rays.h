#pragma once

#include "nn/engine/sine_network.h"

namespace stymo {

struct SineRaysResult {
    Tensor value;
    /// (B, layers, R * N, width), each tile's rows from its first sample's on. Undefined unless
    /// wanted.
    Tensor arguments;
};

/// The forward pass of nn/ops/sine_rays.h. Shapes are checked by the op. Keeping arguments does not
/// change the value.
[[nodiscard]] SineRaysResult sine_rays_forward(const RayPoints& rays,
                                               const SineNetworkOf<Tensor>& network,
                                               bool keep_arguments);

/// Gradients of all parts of the network, in their shapes; those of the weights stay undefined
/// unless wanted. Undefined `arguments` are computed once more. Sums are grouped by runs of rays,
/// whatever the number of threads.
[[nodiscard]] SineNetworkOf<Tensor> sine_rays_backward(const RayPoints& rays,
                                                       const SineNetworkOf<Tensor>& network,
                                                       const Tensor& arguments, const Tensor& dL_dy,
                                                       bool with_weights);

}  // namespace stymo
