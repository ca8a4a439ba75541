#include "nn/models/decoder.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/mapping.h"
#include "render/tracked_rays.h"

namespace stymo {
namespace {

constexpr std::int64_t geometry_size = code_sizes[0] + code_sizes[1];
constexpr std::int64_t appearance_size = code_sizes[2] + code_sizes[3];

/// Number of doublings from the ray grid to an image of this side, or nothing if no number of doublings gets there.
std::optional<std::size_t> block_count(std::int64_t rays_per_side, std::int64_t resolution) {
    std::size_t count = 0;
    std::int64_t side = rays_per_side;
    for (; side < resolution; side *= 2) ++count;
    if (side != resolution || count == 0) return std::nullopt;
    return count;
}

std::size_t checked_block_count(const DecoderConfig& config) {
    if (config.rays.rays_per_side < 1)
        fail<ConfigError>("decoder.rays_per_side must be positive, got ", config.rays.rays_per_side);
    const auto count = block_count(config.rays.rays_per_side, config.resolution);
    if (!count) {
        fail<ConfigError>("decoder.resolution ", config.resolution, " is not decoder.rays_per_side ", config.rays.rays_per_side,
                          " doubled once or more");
    }
    if (*count > config.block_channels.size()) {
        fail<ConfigError>("decoder.resolution ", config.resolution, " needs ", *count, " numbers in decoder.block_channels, got ",
                          config.block_channels.size());
    }
    return *count;
}

DepthPlanes parse_planes(const std::string& name) {
    if (name == "world_z") return DepthPlanes::world_z;
    if (name == "optical_axis") return DepthPlanes::optical_axis;
    fail<ConfigError>("decoder.depth_planes must be world_z or optical_axis, got ", name);
}

Variable geometry_style(const Codes& w) {
    return concat({w.identity(), w.expression()}, 1);
}
Variable appearance_style(const Codes& w) {
    return concat({w.texture(), w.light()}, 1);
}

}  // namespace

void describe(ConfigSchema& schema, DecoderConfig& config) {
    const auto key = [](const char* name) { return std::string("decoder.") + name; };
    schema.integer(key("resolution"), config.resolution, 16, 1024,
                   "side of the largest image (paper: 512; 64, 128 or 256 leave blocks out)");
    schema.integer(key("rays_per_side"), config.rays.rays_per_side, 4, 128, "rays along one side of the feature map (paper: 32)");
    schema.integer(key("field_width"), config.field_width, 1, 4096,
                   "channels of the sine layers (paper: silent; 256 equals its feature channels)");
    schema.integer(key("field_layers"), config.field_layers, 1, 32, "sine layers before the density (paper: silent; NeRF has 8)");
    schema.integer(key("feature_channels"), config.feature_channels, 1, 4096,
                   "channels of the rendered feature map (paper: 256)");
    schema.integer(key("frequencies"), config.frequencies, 0, 16,
                   "of the positional encoding, 3 + 6 frequencies numbers (paper: silent; NeRF has 10)");
    schema.integers(key("block_channels"), config.block_channels, 1, 4096,
                    "channels of the render blocks from coarse to fine (paper: silent; HeadNeRF has 128, 64, 32, 32)");
    schema.integer(key("mask_channels"), config.mask_channels, 1, 4096, "channels of the mask branch (paper: silent)");
    schema.boolean(key("mask_detach"), config.mask_detach,
                   "the mask loss trains the mask branch alone (paper: false, it is minimised over all of the decoder)");
    schema.integer(key("mapping_layers"), config.mapping_layers, 1, 16,
                   "layers of each mapping network (paper: silent; StyleGAN2 has 8)");
    schema.number(key("mapping_learning_rate_multiplier"), config.mapping_learning_rate_multiplier, 1e-4, 1.0,
                  "of the mapping networks (paper: silent; 0.01 in StyleGAN2, which freezes them at stage 1's rate)");
    schema.choice(key("depth_planes"), config.depth_planes, {"world_z", "optical_axis"},
                  "planes that bound the samples: of the world (paper: silent; HeadNeRF's) or across the view, for any yaw");
    schema.number(key("near_z"), config.rays.near_z, -100.0, 100.0, "near plane (paper: silent; HeadNeRF has 2.5)");
    schema.number(key("far_z"), config.rays.far_z, -100.0, 100.0, "far plane (paper: silent; HeadNeRF has -3.5)");
    schema.boolean(key("pixel_centers"), config.rays.pixel_centers,
                   "rays through the middle of their pixels; HeadNeRF's go through a corner");
}

struct Decoder::Layers {
    DecoderConfig config;
    std::vector<Mapping> mappings;
    RadianceField field;
    std::vector<std::int64_t> sides;
    std::vector<RenderBlock> blocks;
    std::optional<MaskBranch> mask;

    Layers(const DecoderConfig& decoder_config, ParameterStore& store, const std::string& prefix, Rng& rng);
    [[nodiscard]] RaySamples samples_of(const Codes& w, const std::vector<Camera>& cameras, std::int64_t samples_per_ray,
                                        Rng* jitter) const;
    /// Number of blocks up to a picture of this side; 0: all.
    [[nodiscard]] std::size_t blocks_for(std::int64_t resolution) const;
};

Decoder::Layers::Layers(const DecoderConfig& decoder_config, ParameterStore& store, const std::string& prefix, Rng& rng)
    : config(decoder_config),
      field({.frequencies = config.frequencies,
             .width = config.field_width,
             .layers = config.field_layers,
             .feature_channels = config.feature_channels,
             .style_size = geometry_size},
            store, prefix + ".field", rng) {
    const std::size_t count = checked_block_count(config);
    config.rays.planes = parse_planes(config.depth_planes);
    for (std::size_t i = 0; i < code_names.size(); ++i) {
        mappings.emplace_back(store, prefix + ".mapping." + code_names[i], code_sizes[i], config.mapping_layers,
                              config.mapping_learning_rate_multiplier, rng);
    }
    std::vector<std::string> names;
    std::int64_t in = config.feature_channels;
    for (std::size_t i = 0; i < count; ++i) {
        sides.push_back(config.rays.rays_per_side << (i + 1));
        names.push_back(std::to_string(sides.back()));
        blocks.emplace_back(store, prefix + ".block" + names.back(), in, config.block_channels[i], appearance_size, rng);
        in = config.block_channels[i];
    }
    mask.emplace(store, prefix + ".mask", std::span(config.block_channels).first(count), names, config.mask_channels, rng);
}

RaySamples Decoder::Layers::samples_of(const Codes& w, const std::vector<Camera>& cameras, std::int64_t samples_per_ray,
                                       Rng* jitter) const {
    if (static_cast<std::int64_t>(cameras.size()) != w.batch())
        fail<ShapeError>(cameras.size(), " cameras for codes of ", w.batch(), " faces");
    RaySampling sampling = config.rays;
    sampling.samples_per_ray = samples_per_ray;
    return sample_rays(cameras, sampling, jitter, w.identity().dtype());
}

std::size_t Decoder::Layers::blocks_for(std::int64_t resolution) const {
    if (resolution == 0) return blocks.size();
    for (std::size_t i = 0; i < sides.size(); ++i) {
        if (sides[i] == resolution) return i + 1;
    }
    std::string list;
    for (const std::int64_t side : sides) list += (list.empty() ? "" : ", ") + std::to_string(side);
    fail<ValueError>("this model renders pictures with a side of ", list, ", not ", resolution);
}

Decoder::Decoder(const DecoderConfig& config, ParameterStore& store, const std::string& prefix, Rng& rng)
    : layers_(std::make_unique<Layers>(config, store, prefix, rng)) {}
Decoder::~Decoder() = default;
Decoder::Decoder(Decoder&&) noexcept = default;

const DecoderConfig& Decoder::config() const {
    return layers_->config;
}

Codes Decoder::map(const Codes& z) const {
    Codes w;
    for (std::size_t i = 0; i < w.groups.size(); ++i) {
        if (!(z.groups[i].shape() == Shape{z.batch(), code_sizes[i]}))
            fail<ShapeError>("code ", code_names[i], " must be (", z.batch(), ", ", code_sizes[i], "), got ",
                             z.groups[i].shape());
        w.groups[i] = layers_->mappings[i](z.groups[i]);
    }
    return w;
}

Decoded Decoder::operator()(const Codes& z, const std::vector<Camera>& cameras, const DecodeOptions& options) const {
    const Codes w = map(z);
    RaySamples samples = layers_->samples_of(w, cameras, options.samples_per_ray, options.jitter);
    const RayPoints points{samples.points, samples.deltas, options.kept_samples};
    RenderedRays rays =
        options.orbits.defined()
            ? layers_->field.render_tracked(tracked_points(options.orbits, cameras, config().rays, samples.depths), points,
                                            geometry_style(w))
            : layers_->field.render(points, geometry_style(w),
                                    options.keep_field ? SineArguments::kept : SineArguments::recomputed);
    const std::int64_t side = config().rays.rays_per_side;
    const Variable features = layers_->field.finish(rays.composited, sum(rays.weights.weights, {2}));

    Decoded decoded = decode_feature_map(reshape(features, {w.batch(), side, side, config().feature_channels}), w, options);
    decoded.weights = std::move(rays.weights);
    decoded.samples = std::move(samples);
    return decoded;
}

Decoded Decoder::decode_feature_map(const Variable& feature_map, const Codes& w, const DecodeOptions& options) const {
    const std::int64_t side = config().rays.rays_per_side;
    if (!(feature_map.shape() == Shape{w.batch(), side, side, config().feature_channels})) {
        fail<ShapeError>("feature map must be (", w.batch(), ", ", side, ", ", side, ", ", config().feature_channels, "), got ",
                         feature_map.shape());
    }
    const Variable style = appearance_style(w);
    Decoded decoded;
    decoded.feature_map = feature_map;
    std::vector<Variable> features;
    Rendered rendered{feature_map, {}};
    for (std::size_t i = 0; i < layers_->blocks_for(options.resolution); ++i) {
        rendered = layers_->blocks[i](rendered, style, options.recompute_blocks);
        decoded.images.push_back(tanh(rendered.rgb));
        if (options.mask) features.push_back(config().mask_detach ? rendered.features.detach() : rendered.features);
    }
    if (options.mask && options.recompute_blocks) {
        decoded.mask_logit =
            recompute([mask = *layers_->mask](std::span<const Variable> inputs) { return mask(inputs); }, features);
    } else if (options.mask) {
        decoded.mask_logit = (*layers_->mask)(features);
    }
    return decoded;
}

Tensor Decoder::compositing_weights(const Codes& z, const std::vector<Camera>& cameras, std::int64_t samples_per_ray) const {
    const Codes w = detached(map(z));
    const RaySamples samples = layers_->samples_of(w, cameras, samples_per_ray, nullptr);
    return layers_->field.render({samples.points, samples.deltas, {}}, geometry_style(w)).weights.weights.value();
}

Variable Decoder::density(const Variable& points, const Codes& w) const {
    return layers_->field(points, geometry_style(w), true).density;
}

FoldedField Decoder::folded_field(const Codes& w) const {
    return layers_->field.folded(geometry_style(w));
}

std::vector<FoldedRenderBlock> Decoder::folded_blocks(const Codes& w, std::int64_t resolution) const {
    std::vector<FoldedRenderBlock> blocks;
    const Variable style = appearance_style(w);
    for (std::size_t i = 0; i < layers_->blocks_for(resolution); ++i) blocks.push_back(layers_->blocks[i].folded(style));
    return blocks;
}

FoldedMaskBranch Decoder::folded_mask() const {
    return layers_->mask->folded();
}

}  // namespace stymo
