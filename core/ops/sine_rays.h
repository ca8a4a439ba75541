#pragma once

#include <functional>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// Modulated layer activation(demodulation (weight (scale x)) + bias). Value: Variable or Tensor.
template <class Value>
struct ModulatedLayerOf {
    Value weight;        ///< (1, out, in)
    Value scale;         ///< (B, 1, in)
    Value demodulation;  ///< (B, out, 1)
    Value bias;          ///< (out)
};

/// Radiance field of modulated sine layers of one width on the encoding of points, (x, sin x, cos x, sin 2x, ...) with
/// 3 + 6 frequencies numbers. The last layer gives the features; the density is softplus(density layer - 1) of what it is given.
template <class Value>
struct SineNetworkOf {
    std::int64_t frequencies = 0;
    std::size_t skip_layer = 0;  ///< layer whose input begins with the encoding once more; 0: none
    std::vector<ModulatedLayerOf<Value>> layers;
    Value density_weight;  ///< (1, width)
    Value density_bias;    ///< (1)
};
using ModulatedLayer = ModulatedLayerOf<Variable>;
using SineNetwork = SineNetworkOf<Variable>;

/// B faces with R rays of N samples each.
struct RayPoints {
    Tensor points;  ///< (B, R * N, 3)
    Tensor deltas;  ///< (B, R, N)
    /// (B, R, N), 0 where a sample is left out as if its density were 0; undefined: none is.
    Tensor kept{};
};

/// What lies between the forward and the backward pass.
enum class SineArguments {
    recomputed,  ///< nothing: each tile is computed once more
    kept,  ///< the arguments of all sines, (layers * width) numbers for each sample; a third faster without weight gradients
};

/// The same result composed of ops.
using SineRaysComposition = std::function<Variable(const RayPoints&, const SineNetwork&)>;

/// Field and compositing (render/composite.h) of rays: (B, R, N + 1 + width), the weights of the samples, the transmittance
/// behind them, the features under the weights. Tile by tile: unless arguments are kept, what is stored beside the result does
/// not grow with R or N. Where no weight matrix is tracked, the backward pass makes no product for one: the gradients of scale
/// and demodulation follow from what passes through. With create_graph the gradients are those of the composition. Throws
/// ShapeError for extents that do not fit.
[[nodiscard]] Variable sine_rays(const RayPoints& rays, const SineNetwork& network, const SineRaysComposition& composition,
                                 SineArguments arguments = SineArguments::recomputed);

}  // namespace stymo
