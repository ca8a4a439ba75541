#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/config.h"
#include "nn/models/field.h"
#include "render/rays.h"

namespace stymo {

/// The sides of the images that a model renders and compares, in ascending order. Each side is
/// twice the one before.
class ResolutionLadder {
public:
    /// Throws ValueError unless `smallest` is positive and doubling it zero or more times gives
    /// `largest`.
    ResolutionLadder(std::int64_t smallest, std::int64_t largest);

    [[nodiscard]] const std::vector<std::int64_t>& sides() const { return sides_; }
    [[nodiscard]] std::size_t count() const { return sides_.size(); }
    [[nodiscard]] std::int64_t smallest() const { return sides_.front(); }
    [[nodiscard]] std::int64_t largest() const { return sides_.back(); }
    /// The number of sides up to `side`; 0 stands for the largest. Throws ValueError, which lists
    /// the sides, if `side` is not one of them.
    [[nodiscard]] std::size_t count_up_to(std::int64_t side) const;
    /// The part of the ladder up to this side. Throws like `count_up_to`.
    [[nodiscard]] ResolutionLadder up_to(std::int64_t side) const;
    /// The largest side of at most `most`, or the smallest side.
    [[nodiscard]] std::int64_t largest_within(std::int64_t most) const;
    /// "64, 128, 256"
    [[nodiscard]] std::string text() const;

private:
    std::vector<std::int64_t> sides_;
};

/// Configuration of the decoder. The defaults are the paper's; configs/keys.md marks those that the
/// paper does not state.
struct DecoderConfig {
    std::int64_t resolution = 512;  ///< side of the largest image: 64, 128, 256 or 512
    /// "modulation" (paper) or "concatenation" (HeadNeRF); see nn/models/field.h.
    std::string conditioning = "modulation";
    /// "blocks": render blocks compute the image from a feature map of few rays. "none": each pixel
    /// has a ray of its own, which gives its colour.
    std::string render = "blocks";
    std::int64_t field_width = 256;  ///< channels of the field's layers
    /// Layers before the density head. Layer skip_layer_of(field_layers) reads the encoding once
    /// more.
    std::int64_t field_layers = 8;
    std::int64_t feature_channels = 256;  ///< d_f, channels of the rendered feature map
    std::int64_t frequencies = 10;        ///< octaves of the positional encoding
    /// The initial weights of the inputs of frequency 2^k are multiplied by 2^(-k * falloff), so
    /// that training begins with the low frequencies.
    double frequency_falloff = 0.0;
    /// Output channels of the render blocks for the sides 64, 128, ...; entries beyond `resolution`
    /// are ignored.
    std::vector<std::int64_t> block_channels{128, 64, 32, 32};
    std::int64_t mask_channels = 16;
    /// Stops the gradient of the mask loss at the mask branch, so that it does not reach the render
    /// blocks.
    bool mask_detach = false;
    std::int64_t mapping_layers = 4;  ///< 0: no mapping networks, W equals Z
    double mapping_learning_rate_multiplier = 1.0;
    std::string depth_planes = "world_z";  ///< "world_z" or "optical_axis"; sets rays.planes
    /// rays_per_side is half the smallest image's side; with render blocks it is also the side of
    /// the feature map. DecodeOptions::samples_per_ray sets the number of samples.
    RaySampling rays;
};

/// Binds the fields under "decoder." .
void describe(ConfigSchema& schema, DecoderConfig& config);

/// The sides of the decoder's images: from twice `rays_per_side` up to `resolution`. Throws
/// ConfigError if doubling does not give `resolution`, or if `block_channels` has too few entries.
[[nodiscard]] ResolutionLadder resolution_ladder(const DecoderConfig& config);

/// The field that the configuration selects. Throws ConfigError for a combination that does not
/// exist.
[[nodiscard]] FieldConfig field_config(const DecoderConfig& config);
/// `rays` with the planes that `depth_planes` names. Throws ConfigError for another name, and
/// unless `near_z` is above `far_z`.
[[nodiscard]] RaySampling ray_sampling(const DecoderConfig& config);

}  // namespace stymo
