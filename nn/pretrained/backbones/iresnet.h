#pragma once

#include <array>
#include <memory>
#include <string>

#include "core/rng.h"
#include "nn/pretrained/backbones/backbone.h"

namespace stymo {

/// Number of residual blocks and channels of each of the four stages, and the sizes of input and
/// output.
struct IresnetLayout {
    std::array<int, 4> blocks{};
    std::array<std::int64_t, 4> widths{64, 128, 256, 512};
    std::int64_t input_side = 112;  ///< a multiple of 16: each stage halves the image
    std::int64_t embedding_size = 512;
    std::int64_t saved = 0;  ///< Backbone::saved
};

/// A published size of the network.
struct IresnetDepth {
    const char* name;
    std::array<int, 4> blocks;
};
inline constexpr std::array<IresnetDepth, 5> iresnet_depths{{{"iresnet18", {2, 2, 2, 2}},
                                                             {"iresnet34", {3, 4, 6, 3}},
                                                             {"iresnet50", {3, 4, 14, 3}},
                                                             {"iresnet100", {3, 13, 30, 3}},
                                                             {"iresnet200", {6, 26, 60, 6}}}};

/// The improved residual network of insightface (recognition/arcface_torch/backbones/iresnet.py),
/// image -> embedding, not normalised. Any image is resized to `input_side` by antialiased bicubic
/// resampling; its values stay in [-1, 1]. PReLU has one slope for each channel. Batch norms have
/// epsilon 1e-5 and stay in inference mode; the weight of the last one is fixed to 1. Initial
/// weights of convolutions are N(0, 0.1), as in insightface. The initial running variances match
/// these weights, so that training from scratch starts with activations of unit size in every
/// layer. Published files use insightface's names ("layer1.0.bn1.weight", "fc.weight",
/// "features.running_var"). Throws ValueError if the input side is not a multiple of 16.
[[nodiscard]] std::unique_ptr<Backbone> make_iresnet(const IresnetLayout& layout,
                                                     ParameterStore& store,
                                                     const std::string& prefix, Rng& rng);

/// 112x112 pixels -> 512 numbers; 43.6 million parameters, 6.3 billion multiply-adds.
[[nodiscard]] std::unique_ptr<Backbone> make_iresnet50(ParameterStore& store,
                                                       const std::string& prefix, Rng& rng);
/// 112x112 pixels -> 512 numbers; 65.2 million parameters, 12.1 billion multiply-adds.
[[nodiscard]] std::unique_ptr<Backbone> make_iresnet100(ParameterStore& store,
                                                        const std::string& prefix, Rng& rng);

}  // namespace stymo
