#pragma once

#include <cstdint>
#include <vector>

#include "core/autograd/variable.h"
#include "nn/layers/linear.h"
#include "nn/layers/modulated_linear.h"

/// What the field engine is given: layers and samples.
namespace stymo {

/// Radiance field of modulated sine layers of one width on the encoding of points, (x, sin x, cos
/// x, sin 2x, ...) with 3 + 6 frequencies channels. The last layer gives the features. The density
/// is softplus(density layer - 1) of the last layer's input.
template <class Value>
struct SineNetworkOf {
    std::int64_t frequencies = 0;
    std::size_t skip_layer = 0;  ///< layer whose input begins with the encoding once more; 0: none
    std::vector<ModulatedLayerOf<Value>> layers;
    Value density_weight;  ///< (1, width)
    Value density_bias;    ///< (1)
};
using SineNetwork = SineNetworkOf<Variable>;

/// B faces with R rays of N samples each.
struct RayPoints {
    Tensor points;  ///< (B, R * N, 3)
    Tensor deltas;  ///< (B, R, N)
    /// (B, R, N), 0 where a sample is left out as if its density were 0; undefined: none is.
    Tensor significant{};
    /// Samples with a smaller weight take no part in the backward pass. Their optical depth does.
    double gradient_tolerance = 0.0;
};

/// The field of one face: its style is folded into the weights of every layer.
struct FoldedField {
    std::int64_t frequencies = 0;
    std::size_t skip_layer = 0;  ///< layer whose input begins with the encoding once more; 0: none
    std::vector<FoldedLayer> layers;
    FoldedLayer density;  ///< one output; the density is softplus(output - 1)
    FoldedLayer feature0;
    FoldedLayer feature1;  ///< after compositing
};

/// What the field of face `face` becomes. Without the layer after compositing, which is not part of
/// the network.
[[nodiscard]] FoldedField folded(const SineNetworkOf<Tensor>& network, std::int64_t face);

}  // namespace stymo
