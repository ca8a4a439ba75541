#pragma once

#include "nn/engine/sine_network.h"

namespace stymo {

struct FieldPassResult {
    /// (B, R, N + 1 + width): weights, transmittance behind the last sample, composited features.
    Tensor value;
    /// Arguments of the sines, (B, layers, R * N, width); undefined unless they were asked for. The
    /// selected samples of a tile are stored in consecutive rows, from the row of the tile's first
    /// ray on.
    Tensor arguments;
};

/// The forward pass of nn/engine/render_field.h, which checks the shapes. Keeping arguments does
/// not change the value.
[[nodiscard]] FieldPassResult render_field_forward(const RayPoints& rays,
                                                   const SineNetworkOf<Tensor>& network,
                                                   bool keep_arguments);

/// Gradients of all parts of the network, each in the shape of its part. The gradients of the
/// layers' weights stay undefined unless `with_weights`. Sine arguments are computed again if
/// `forward` has none. With a gradient_tolerance above 0, `forward` must have no arguments but must
/// have its value, whose weights decide which samples get a gradient. The result does not depend on
/// the number of threads.
[[nodiscard]] SineNetworkOf<Tensor> render_field_backward(const RayPoints& rays,
                                                          const SineNetworkOf<Tensor>& network,
                                                          const FieldPassResult& forward,
                                                          const Tensor& dL_dy, bool with_weights);

}  // namespace stymo
