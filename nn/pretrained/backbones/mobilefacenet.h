#pragma once

#include <map>
#include <memory>
#include <string>

#include "core/rng.h"
#include "nn/pretrained/backbones/backbone.h"

namespace stymo {

/// MobileFaceNet (Chen et al. 2018) as foamliu/MobileFaceNet trains it with the ArcFace loss:
/// 112x112 pixels -> 128 numbers, not normalised; 1.0 million parameters, 0.2 billion
/// multiply-adds. Any image is resized to 112x112 by antialiased bicubic resampling, and its values
/// are converted from [-1, 1] to the ImageNet mean and standard deviation of the published weights.
/// All activations are ReLU6, except for a plain ReLU in the depthwise separable layer after the
/// first layer. Batch norms have epsilon 1e-5 and stay in inference mode.
[[nodiscard]] std::unique_ptr<Backbone> make_mobilefacenet(ParameterStore& store,
                                                           const std::string& prefix, Rng& rng);

/// Names and shapes of the published tensors that the network reads, convolutions as (out, in,
/// height, width).
[[nodiscard]] std::map<std::string, Shape> mobilefacenet_tensors();

}  // namespace stymo
