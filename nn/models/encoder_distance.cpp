#include "nn/models/encoder_distance.h"

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/pretrained/perceptual/feature_distance.h"

namespace stymo {

EncoderDistance::EncoderDistance(const Encoder& encoder) : backbone_(encoder.backbone()) {
    if (!backbone_.has_activations())
        fail<ConfigError>(
            "reconstruction.perceptual_network = encoder needs encoder.backbone = small_conv");
}

EncoderDistance::Features EncoderDistance::features(const Variable& images) const {
    Features features;
    for (const Variable& activation : backbone_.activations(images))
        features.push_back(unit_channels(activation, feature_epsilon));
    return features;
}

Variable EncoderDistance::distance_to(const Variable& images, const Features& target) const {
    const std::vector<Variable> activations = backbone_.activations(images);
    if (target.size() != activations.size())
        fail<ShapeError>("the encoder compares ", activations.size(), " features, got ",
                         target.size());
    Variable total;
    for (std::size_t i = 0; i < activations.size(); ++i) {
        const Tensor ones = Tensor::full({activations[i].shape(3)}, 1.0, activations[i].dtype());
        const Variable term = feature_distance(activations[i], target[i].value(), ones);
        total = total.defined() ? total + term : term;
    }
    return total / static_cast<double>(activations.size());
}

LayerMemory EncoderDistance::memory(std::int64_t side) const {
    // Two copies of the activations; most of them belong to the first layer.
    constexpr std::int64_t per_pixel = 64;
    return {0, per_pixel * side * side};
}

}  // namespace stymo
