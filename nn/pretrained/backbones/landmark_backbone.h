#pragma once

#include <memory>
#include <string>

#include "core/rng.h"
#include "nn/pretrained/backbones/backbone.h"

namespace stymo {

/// LandmarkFeatures of the network in configs/models/landmarks: 192 numbers, which tell where
/// brows, eyes and lips are and little else. It sees the square of FFHQ's crop in
/// which faces lie on average, resized to 80 x 80 pixels.
[[nodiscard]] std::unique_ptr<Backbone> make_landmark_backbone(ParameterStore& store,
                                                               const std::string& prefix, Rng& rng);

}  // namespace stymo
