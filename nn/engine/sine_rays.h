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
/// unless wanted. Arguments that `forward` lacks are computed once more; with a gradient_tolerance
/// they are, and the forward pass's value tells the samples that count. Sums are grouped by runs of
/// rays, whatever the number of threads.
[[nodiscard]] SineNetworkOf<Tensor> sine_rays_backward(const RayPoints& rays,
                                                       const SineNetworkOf<Tensor>& network,
                                                       const SineRaysResult& forward,
                                                       const Tensor& dL_dy, bool with_weights);

}  // namespace stymo
