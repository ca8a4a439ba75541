#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/layers/conv_layer.h"
#include "nn/parameter_store.h"

namespace stymo {

/// One step of a classification network's feature stack. Convolutions have a bias and end in a
/// ReLU.
struct TrunkLayer {
    enum class Kind {
        convolution,
        fire,  ///< SqueezeNet: 1x1 to `squeezed` channels, then 1x1 and 3x3 to `out` / 2 channels
               ///< each, side by side
        max_pool  ///< rounds its size as the network does
    };
    Kind kind;
    int place;             ///< its number in torchvision's `features`
    std::int64_t out = 0;  ///< channels
    int kernel = 3;
    int stride = 1;
    int padding = 0;
    std::int64_t squeezed = 0;
    bool tap = false;  ///< whether LPIPS compares the output of this layer
};

/// A network for which LPIPS has linear heads.
struct TrunkDescription {
    std::string name;          ///< torchvision's
    std::string weights_file;  ///< that torchvision publishes
    std::string heads_name;    ///< of the heads in LPIPS' own release: "vgg", "alex", "squeeze"
    bool pool_ceil_mode = false;
    std::vector<TrunkLayer> layers;
    /// For each pixel of an image, the numbers that are alive at the peak of the backward pass,
    /// measured.
    std::int64_t alive_per_pixel = 0;
};

/// vgg16, alexnet and squeezenet1_1 up to their last tap (Simonyan and Zisserman 2015, Krizhevsky
/// 2014, Iandola et al. 2016).
[[nodiscard]] const std::vector<TrunkDescription>& trunk_descriptions();
[[nodiscard]] std::vector<std::int64_t> tap_channels(const TrunkDescription& description);

/// The feature stack of one of these networks.
class Trunk {
public:
    /// Creates `prefix`features.{place}.weight and .bias, He normal from `rng`; a fire layer's are
    /// `prefix`features.{place}.squeeze, .expand1x1, .expand3x3 as in torchvision. Weights are
    /// (out, kernel, kernel, in).
    Trunk(const TrunkDescription& description, ParameterStore& store, const std::string& prefix,
          Rng& rng);

    /// The activations at the taps for images (B, S, S, 3) that are normalised as the network
    /// expects; S at least smallest_side().
    [[nodiscard]] std::vector<Variable> operator()(const Variable& images) const;
    [[nodiscard]] std::int64_t smallest_side() const;

private:
    struct Stage {
        TrunkLayer layer;
        std::vector<ConvLayer> convolutions;  ///< one; three of a fire layer; none of a pool
    };
    [[nodiscard]] Variable apply(const Stage& stage, const Variable& x) const;

    bool pool_ceil_mode_;
    std::vector<Stage> stages_;
};

}  // namespace stymo
