#pragma once

#include <memory>
#include <string>

#include "core/rng.h"
#include "nn/pretrained/backbones/backbone.h"

namespace stymo {

/// Five strided 3x3 convolutions and a linear layer, 64x64 pixels -> 256 numbers; 1.2 million
/// parameters, 18 million multiply-adds. It can be trained from scratch in minutes. Layers have an
/// equalised learning rate and leaky ReLU with slope 0.2 and gain sqrt(2). Any image is resized to
/// 64x64 by antialiased bicubic resampling.
[[nodiscard]] std::unique_ptr<Backbone> make_small_conv(ParameterStore& store,
                                                        const std::string& prefix, Rng& rng);

}  // namespace stymo
