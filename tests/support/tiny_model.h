#pragma once

#include <cstdint>

#include "nn/models/model.h"

namespace stymo::test {

/// The smallest model of the usual structure: 64 rays, one image of 16 x 16 pixels.
[[nodiscard]] inline ModelConfig tiny_model_config() {
    ModelConfig config;
    config.decoder.resolution = 16;
    config.decoder.rays.rays_per_side = 8;
    config.decoder.field_width = 8;
    config.decoder.field_layers = 2;
    config.decoder.feature_channels = 8;
    config.decoder.frequencies = 2;
    config.decoder.block_channels = {6};
    config.decoder.mask_channels = 2;
    config.decoder.mapping_layers = 1;
    config.encoder.backbone = "small_conv";
    config.encoder.head_width = 8;
    config.reconstruction.resolution_weights = {1.0};
    config.reconstruction.perceptual_weight = 0.0;
    config.reconstruction.fit_samples_per_ray = 4;
    return config;
}

[[nodiscard]] inline Model tiny_model(std::uint64_t seed = 1) {
    Rng rng(seed);
    return {tiny_model_config(), rng};
}

/// Codes in Z with normal elements.
[[nodiscard]] inline Codes random_codes(std::int64_t batch, std::uint64_t seed,
                                        double deviation = 1.0, DType dtype = DType::float32) {
    Rng rng(seed);
    Codes codes;
    for (std::size_t group = 0; group < code_sizes.size(); ++group)
        codes.groups[group] = rng.normal({batch, code_sizes[group]}, 0.0, deviation, dtype);
    return codes;
}

}  // namespace stymo::test
