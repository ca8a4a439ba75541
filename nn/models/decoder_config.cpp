#include "nn/models/decoder_config.h"

#include <algorithm>
#include <iterator>

#include "core/error.h"
#include "nn/models/codes.h"

namespace stymo {

ResolutionLadder::ResolutionLadder(std::int64_t smallest, std::int64_t largest) {
    for (std::int64_t side = smallest; side > 0 && side <= largest; side *= 2)
        sides_.push_back(side);
    if (sides_.empty() || sides_.back() != largest)
        fail<ValueError>("a side of ", largest, " pixels is not ", smallest,
                         " doubled any number of times");
}

std::size_t ResolutionLadder::count_up_to(std::int64_t side) const {
    if (side == 0) return count();
    const auto found = std::ranges::find(sides_, side);
    if (found == sides_.end())
        fail<ValueError>("this model renders images with a side of ", text(), ", not ", side);
    return static_cast<std::size_t>(found - sides_.begin()) + 1;
}

ResolutionLadder ResolutionLadder::up_to(std::int64_t side) const {
    return {smallest(), sides_[count_up_to(side) - 1]};
}

std::int64_t ResolutionLadder::largest_within(std::int64_t most) const {
    const auto above = std::ranges::upper_bound(sides_, most);
    return above == sides_.begin() ? smallest() : *std::prev(above);
}

std::string ResolutionLadder::text() const {
    std::string list;
    for (const std::int64_t side : sides_)
        list += (list.empty() ? "" : ", ") + std::to_string(side);
    return list;
}

namespace {

DepthPlanes parse_planes(const std::string& name) {
    if (name == "world_z") return DepthPlanes::world_z;
    if (name == "optical_axis") return DepthPlanes::optical_axis;
    fail<ConfigError>("decoder.depth_planes must be world_z or optical_axis, got ", name);
}

Conditioning parse_conditioning(const DecoderConfig& config) {
    if (config.render != "blocks" && config.render != "none")
        fail<ConfigError>("decoder.render must be blocks or none, got ", config.render);
    if (config.conditioning == "concatenation") {
        if (config.frequency_falloff != 0.0)
            fail<ConfigError>("decoder.frequency_falloff needs decoder.conditioning = modulation");
        if (config.render == "none" && config.mask_detach)
            fail<ConfigError>(
                "decoder.mask_detach needs render blocks; with decoder.render = none the field "
                "itself is the mask");
        return Conditioning::concatenation;
    }
    if (config.conditioning != "modulation")
        fail<ConfigError>("decoder.conditioning must be modulation or concatenation, got ",
                          config.conditioning);
    if (config.render == "none")
        fail<ConfigError>(
            "decoder.render = none needs decoder.conditioning = concatenation: only render blocks "
            "bring texture and "
            "light to a modulated field");
    return Conditioning::modulation;
}

}  // namespace

void describe(ConfigSchema& schema, DecoderConfig& config) {
    const auto key = [](const char* name) { return std::string("decoder.") + name; };
    schema.integer(key("resolution"), config.resolution, 16, 1024,
                   "side of the largest image (paper: 512); 64, 128 or 256 use fewer blocks");
    schema.integer(key("rays_per_side"), config.rays.rays_per_side, 4, 128,
                   "rays along one side of the feature map (paper: 32)");
    schema.choice(key("conditioning"), config.conditioning, {"modulation", "concatenation"},
                  "codes modulate sine layers and render blocks (paper), or are concatenated to "
                  "the inputs of plain ones (HeadNeRF)");
    schema.choice(key("render"), config.render, {"blocks", "none"},
                  "render blocks on a feature map of few rays (paper), or one ray per pixel "
                  "without blocks (needs concatenation)");
    schema.integer(key("field_width"), config.field_width, 1, 4096,
                   "channels of the field's layers (paper: silent)");
    schema.integer(key("field_layers"), config.field_layers, 1, 32,
                   "the field's layers before the density (paper: silent; NeRF has 8)");
    schema.integer(key("feature_channels"), config.feature_channels, 1, 4096,
                   "channels of the rendered feature map (paper: 256)");
    schema.integer(key("frequencies"), config.frequencies, 0, 16,
                   "number of frequencies of the positional encoding (paper: silent; NeRF has 10)");
    schema.number(key("frequency_falloff"), config.frequency_falloff, 0.0, 4.0,
                  "the first weights of frequency 2^k are multiplied by 2^(-k falloff), so that "
                  "training opens the encoding from coarse to fine (paper: none)");
    schema.integers(key("block_channels"), config.block_channels, 1, 4096,
                    "channels of the render blocks from coarse to fine (paper: silent; HeadNeRF "
                    "has 128, 64, 32, 32)");
    schema.integer(key("mask_channels"), config.mask_channels, 1, 4096,
                   "channels of the mask branch (paper: silent)");
    schema.boolean(key("mask_detach"), config.mask_detach,
                   "the mask loss trains the mask branch alone (paper: false)");
    schema.integer(
        key("mapping_layers"), config.mapping_layers, 0, 16,
        "layers of each mapping network (paper: silent; StyleGAN2 has 8); 0: no mapping networks");
    schema.number(
        key("mapping_learning_rate_multiplier"), config.mapping_learning_rate_multiplier, 1e-4, 1.0,
        "learning rate multiplier of the mapping networks (paper: silent; StyleGAN2 has 0.01)");
    schema.choice(key("depth_planes"), config.depth_planes, {"world_z", "optical_axis"},
                  "planes that bound the samples: world planes (paper: silent; HeadNeRF) or depths "
                  "along the optical axis, for any yaw");
    schema.number(key("near_z"), config.rays.near_z, -100.0, 100.0,
                  "near plane (paper: silent; HeadNeRF has 2.5)");
    schema.number(key("far_z"), config.rays.far_z, -100.0, 100.0,
                  "far plane (paper: silent; HeadNeRF has -3.5)");
    schema.boolean(key("pixel_centers"), config.rays.pixel_centers,
                   "rays through pixel centres; HeadNeRF's go through a corner");
}

ResolutionLadder resolution_ladder(const DecoderConfig& config) {
    const std::int64_t rays = config.rays.rays_per_side;
    if (rays < 1) fail<ConfigError>("decoder.rays_per_side must be positive, got ", rays);
    try {
        const ResolutionLadder ladder(2 * rays, config.resolution);
        if (config.render == "blocks" && ladder.count() > config.block_channels.size())
            fail<ConfigError>("decoder.resolution ", config.resolution, " needs ", ladder.count(),
                              " numbers in decoder.block_channels, got ",
                              config.block_channels.size());
        return ladder;
    } catch (const ValueError&) {
        fail<ConfigError>("decoder.resolution ", config.resolution,
                          " is not decoder.rays_per_side ", rays, " upsampled once or more");
    }
}

FieldConfig field_config(const DecoderConfig& config) {
    const bool colors = config.render == "none";
    return {.conditioning = parse_conditioning(config),
            .frequencies = config.frequencies,
            .width = config.field_width,
            .layers = config.field_layers,
            .channels = colors ? 3 : config.feature_channels,
            .geometry_size = code_sizes[0] + code_sizes[1],
            .appearance_size = code_sizes[2] + code_sizes[3],
            .colors = colors,
            .frequency_falloff = config.frequency_falloff};
}

RaySampling ray_sampling(const DecoderConfig& config) {
    RaySampling rays = config.rays;
    if (rays.near_z <= rays.far_z)
        fail<ConfigError>("decoder.near_z = ", rays.near_z, ": must be above decoder.far_z = ",
                          rays.far_z);
    rays.planes = parse_planes(config.depth_planes);
    return rays;
}

}  // namespace stymo
