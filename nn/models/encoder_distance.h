#pragma once

#include "nn/models/encoder.h"
#include "nn/pretrained/perceptual/perceptual_distance.h"

namespace stymo {

/// A perceptual distance that needs no published weights: activations of the model's own encoder
/// are compared as in LPIPS, but all channel weights are 1 and the result is the mean over the
/// layers.
class EncoderDistance final : public PerceptualDistance {
public:
    /// The encoder must outlive this object and be frozen. Throws ConfigError unless the backbone
    /// has activations.
    explicit EncoderDistance(const Encoder& encoder);

    [[nodiscard]] Features features(const Variable& images) const override;
    [[nodiscard]] Variable distance_to(const Variable& images,
                                       const Features& target) const override;
    [[nodiscard]] LayerMemory memory(std::int64_t side) const override;
    [[nodiscard]] std::string label() const override { return "the model's encoder"; }

private:
    const Backbone& backbone_;
};

}  // namespace stymo
