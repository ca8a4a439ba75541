#include "nn/models/field.h"

#include "core/error.h"
#include "nn/models/concatenated_field.h"
#include "nn/models/radiance_field.h"

namespace stymo {

FoldedField Field::folded(const FieldStyle&) const {
    fail<ValueError>(
        "the fast renderer needs a modulated field, decoder.conditioning = modulation");
}

std::unique_ptr<Field> make_field(const FieldConfig& config, ParameterStore& store,
                                  const std::string& prefix, Rng& rng) {
    if (config.conditioning == Conditioning::concatenation)
        return std::make_unique<ConcatenatedField>(config, store, prefix, rng);
    return std::make_unique<RadianceField>(
        RadianceFieldConfig{.frequencies = config.frequencies,
                            .width = config.width,
                            .layers = config.layers,
                            .feature_channels = config.channels,
                            .style_size = config.geometry_size,
                            .frequency_falloff = config.frequency_falloff},
        store, prefix, rng);
}

}  // namespace stymo
