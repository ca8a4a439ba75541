#pragma once

#include <functional>

#include "nn/engine/sine_network.h"

namespace stymo {

/// The values that are kept between the forward and the backward pass.
enum class SineArguments {
    recomputed,  ///< none: the backward pass computes each tile again
    kept,  ///< the arguments of all sines, layers * width numbers for each sample; a third faster
           ///< if there are no weight gradients
};

/// Computes the same result as a composition of ops.
using FieldComposition = std::function<Variable(const RayPoints&, const SineNetwork&)>;

/// Field and compositing (render/composite.h) of rays -> (B, R, N + 1 + width): the weights of the
/// samples, the transmittance behind the last one, the composited features. Rays are computed tile
/// by tile; unless arguments are kept, the memory beside the result does not grow with R or N. If
/// no weight matrix is tracked, the backward pass computes no weight gradients, which saves a
/// matrix product for each layer. With a gradient_tolerance above 0, samples of smaller weight are
/// left out of the backward pass, and arguments are never kept. With create_graph the gradients are
/// those of the composition. Throws ShapeError for extents that do not match, ValueError for
/// samples that are not in order.
[[nodiscard]] Variable render_field(const RayPoints& rays, const SineNetwork& network,
                                    const FieldComposition& composition,
                                    SineArguments arguments = SineArguments::recomputed);

}  // namespace stymo
