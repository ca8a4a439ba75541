#pragma once

#include <functional>

#include "nn/engine/sine_network.h"

namespace stymo {

/// What lies between the forward and the backward pass.
enum class SineArguments {
    recomputed,  ///< nothing: each tile is computed once more
    kept,  ///< the arguments of all sines, (layers * width) numbers for each sample; a third faster
           ///< without weight gradients
};

/// The same result composed of ops.
using SineRaysComposition = std::function<Variable(const RayPoints&, const SineNetwork&)>;

/// Field and compositing (render/composite.h) of rays: (B, R, N + 1 + width), the weights of the
/// samples, the transmittance behind them, the features under the weights. Tile by tile: unless
/// arguments are kept, what is stored beside the result does not grow with R or N. Where no weight
/// matrix is tracked, the backward pass makes no product for one: the gradients of scale and
/// demodulation follow from what passes through. Samples below the rays' gradient_tolerance are
/// left out of the backward pass; arguments are not kept then. With create_graph the gradients are
/// those of the composition. Throws ShapeError for extents that do not fit, ValueError for samples
/// that are not in order.
[[nodiscard]] Variable sine_rays(const RayPoints& rays, const SineNetwork& network,
                                 const SineRaysComposition& composition,
                                 SineArguments arguments = SineArguments::recomputed);

}  // namespace stymo
