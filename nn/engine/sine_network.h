#pragma once

#include <cstdint>
#include <vector>

#include "core/autograd/variable.h"
#include "nn/layers/linear.h"
#include "nn/layers/modulated_linear.h"

/// Input of the field engine: layers and samples.
namespace stymo {

/// A radiance field: modulated sine layers of equal width on the positional encoding of points, (x,
/// sin x, cos x, sin 2x, ...) with 3 + 6 * frequencies channels. The last layer computes the
/// features. The density is softplus(d - 1), where d is the density layer's output for the input of
/// the last layer.
template <class Value>
struct SineNetworkOf {
    std::int64_t frequencies = 0;
    /// Layer whose input begins with the encoding, besides layer 0; 0: none.
    std::size_t skip_layer = 0;
    std::vector<ModulatedLayerOf<Value>> layers;
    Value density_weight;  ///< (1, width)
    Value density_bias;    ///< (1)
};
using SineNetwork = SineNetworkOf<Variable>;

/// B faces with R rays of N samples each.
struct RayPoints {
    Tensor points;  ///< (B, R * N, 3)
    Tensor deltas;  ///< (B, R, N)
    /// (B, R, N), 0 where a sample is left out as if its density were 0. If undefined, no sample is
    /// left out.
    Tensor significant{};
    /// Samples with a smaller compositing weight get no gradient in the backward pass, but their
    /// optical depth still counts. 0: every sample gets its gradient.
    double gradient_tolerance = 0.0;
};

/// The field of one face. Its style is folded into the weights of every layer.
struct FoldedField {
    std::int64_t frequencies = 0;
    /// Layer whose input begins with the encoding, besides layer 0; 0: none.
    std::size_t skip_layer = 0;
    std::vector<FoldedLayer> layers;
    FoldedLayer density;  ///< one output; the density is softplus(output - 1)
    FoldedLayer feature0;
    FoldedLayer feature1;  ///< applied after compositing
};

/// Folds the style of face `face` into the network. `feature1` stays undefined, since the layer
/// after compositing is not part of the network.
[[nodiscard]] FoldedField folded(const SineNetworkOf<Tensor>& network, std::int64_t face);

}  // namespace stymo
