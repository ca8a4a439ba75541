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
        fire,     ///< SqueezeNet: 1x1 convolution to `squeezed` channels, then 1x1 and 3x3
                  ///< convolutions to `out` / 2 channels each, concatenated
        max_pool  ///< rounds the size of its result as TrunkDescription::pool_ceil_mode says
    };
    Kind kind;
    int index;             ///< index in torchvision's `features`
    std::int64_t out = 0;  ///< channels
    int kernel = 3;
    int stride = 1;
    int padding = 0;
    std::int64_t squeezed = 0;
    bool tap = false;  ///< whether LPIPS compares the output of this layer
};

/// A network for which LPIPS has linear heads.
struct TrunkDescription {
    std::string name;          ///< name in torchvision
    std::string weights_file;  ///< name of the file that torchvision publishes
    /// Name of the heads in the release of LPIPS: "vgg", "alex", "squeeze".
    std::string heads_name;
    bool pool_ceil_mode = false;
    std::vector<TrunkLayer> layers;
    /// Number of elements in memory at the peak of the backward pass, for each pixel of the image;
    /// measured.
    std::int64_t alive_per_pixel = 0;
};

/// vgg16, alexnet and squeezenet1_1 up to their last tap (Simonyan and Zisserman 2015, Krizhevsky
/// 2014, Iandola et al. 2016).
[[nodiscard]] const std::vector<TrunkDescription>& trunk_descriptions();
[[nodiscard]] std::vector<std::int64_t> tap_channels(const TrunkDescription& description);
/// Multiply-adds of one forward pass on one image of side `side`. `network` is a description's
/// name.
[[nodiscard]] std::int64_t trunk_multiply_adds(const std::string& network, std::int64_t side);

/// The feature stack of one of these networks.
class Trunk {
public:
    /// Creates `prefix`features.{index}.weight and .bias, with He-normal weights from `rng`. A fire
    /// layer has `prefix`features.{index}.squeeze, .expand1x1 and .expand3x3, as in torchvision.
    /// Weights are (out, kernel, kernel, in).
    Trunk(const TrunkDescription& description, ParameterStore& store, const std::string& prefix,
          Rng& rng);

    /// The activations at the taps for images (B, S, S, 3) that are normalised as the network
    /// expects; S at least smallest_side().
    [[nodiscard]] std::vector<Variable> operator()(const Variable& images) const;
    [[nodiscard]] std::int64_t smallest_side() const;

private:
    struct Stage {
        TrunkLayer layer;
        std::vector<ConvLayer> convolutions;  ///< one; three for a fire layer; none for a pool
    };
    [[nodiscard]] Variable apply(const Stage& stage, const Variable& x) const;

    bool pool_ceil_mode_;
    std::vector<Stage> stages_;
};

}  // namespace stymo
