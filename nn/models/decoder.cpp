#include "nn/models/decoder.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/mapping.h"
#include "nn/models/image_stage.h"
#include "nn/models/significant_rows.h"
#include "render/tracked_rays.h"

namespace stymo {
namespace {

constexpr std::int64_t geometry_size = code_sizes[0] + code_sizes[1];
constexpr std::int64_t appearance_size = code_sizes[2] + code_sizes[3];

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

FieldConfig field_config(const DecoderConfig& config) {
    const bool colors = config.render == "none";
    return {.conditioning = parse_conditioning(config),
            .frequencies = config.frequencies,
            .width = config.field_width,
            .layers = config.field_layers,
            .channels = colors ? 3 : config.feature_channels,
            .geometry_size = geometry_size,
            .appearance_size = appearance_size,
            .colors = colors,
            .frequency_falloff = config.frequency_falloff};
}

Variable geometry_style(const Codes& w) {
    return concat({w.identity(), w.expression()}, 1);
}
Variable appearance_style(const Codes& w) {
    return concat({w.texture(), w.light()}, 1);
}
FieldStyle field_style(const Codes& w) {
    return {geometry_style(w), appearance_style(w)};
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

struct Decoder::Layers {
    DecoderConfig config;
    ResolutionLadder ladder;
    std::vector<Mapping> mappings;
    std::unique_ptr<Field> field;
    std::unique_ptr<ImageStage> images;

    Layers(const DecoderConfig& decoder_config, ParameterStore& store, const std::string& prefix,
           Rng& rng);
    [[nodiscard]] RaySampling sampling_of(std::int64_t samples_per_ray,
                                          std::int64_t resolution) const;
    [[nodiscard]] RaySamples samples_of(const Codes& w, const std::vector<Camera>& cameras,
                                        const RaySampling& sampling, Rng* jitter) const;
    [[nodiscard]] Tensor weights_of(const RaySamples& samples, const Codes& w) const;
};

Decoder::Layers::Layers(const DecoderConfig& decoder_config, ParameterStore& store,
                        const std::string& prefix, Rng& rng)
    : config(decoder_config),
      ladder(resolution_ladder(config)),
      field(make_field(field_config(config), store, prefix + ".field", rng)) {
    config.rays.planes = parse_planes(config.depth_planes);
    for (std::size_t i = 0; config.mapping_layers > 0 && i < code_names.size(); ++i) {
        mappings.emplace_back(store, prefix + ".mapping." + code_names[i], code_sizes[i],
                              config.mapping_layers, config.mapping_learning_rate_multiplier, rng);
    }
    images = make_image_stage(config, ladder, store, prefix, appearance_size, rng);
}

RaySampling Decoder::Layers::sampling_of(std::int64_t samples_per_ray,
                                         std::int64_t resolution) const {
    RaySampling sampling = config.rays;
    sampling.samples_per_ray = samples_per_ray;
    sampling.rays_per_side = images->rays_per_side(resolution);
    return sampling;
}

RaySamples Decoder::Layers::samples_of(const Codes& w, const std::vector<Camera>& cameras,
                                       const RaySampling& sampling, Rng* jitter) const {
    if (static_cast<std::int64_t>(cameras.size()) != w.batch())
        fail<ShapeError>(cameras.size(), " cameras for codes of ", w.batch(), " faces");
    return sample_rays(cameras, sampling, jitter, w.identity().dtype());
}

Tensor Decoder::Layers::weights_of(const RaySamples& samples, const Codes& w) const {
    return field->render({samples.points, samples.deltas, {}}, field_style(w), false)
        .weights.weights.value();
}

Decoder::Decoder(const DecoderConfig& config, ParameterStore& store, const std::string& prefix,
                 Rng& rng)
    : layers_(std::make_unique<Layers>(config, store, prefix, rng)) {}
Decoder::~Decoder() = default;
Decoder::Decoder(Decoder&&) noexcept = default;

const DecoderConfig& Decoder::config() const {
    return layers_->config;
}

const ResolutionLadder& Decoder::ladder() const {
    return layers_->ladder;
}

Codes Decoder::map(const Codes& z) const {
    Codes w;
    for (std::size_t i = 0; i < w.groups.size(); ++i) {
        if (!(z.groups[i].shape() == Shape{z.batch(), code_sizes[i]}))
            fail<ShapeError>("code ", code_names[i], " must be (", z.batch(), ", ", code_sizes[i],
                             "), got ", z.groups[i].shape());
        w.groups[i] = layers_->mappings.empty() ? z.groups[i] : layers_->mappings[i](z.groups[i]);
    }
    return w;
}

Decoded Decoder::operator()(const Codes& z, const std::vector<Camera>& cameras,
                            const DecodeOptions& options) const {
    const Codes w = map(z);
    const RaySampling sampling = layers_->sampling_of(options.samples_per_ray, options.resolution);
    RaySamples samples = layers_->samples_of(w, cameras, sampling, options.jitter);
    RayPoints points{samples.points, samples.deltas, options.significant_samples,
                     options.gradient_tolerance};
    const FieldStyle style = field_style(w);
    // The ops that track points keep much for each sample, so those of little weight are left out.
    if (options.orbits.defined() && !points.significant.defined() &&
        options.gradient_tolerance > 0.0)
        points.significant = significant_samples(layers_->weights_of(samples, detached(w)),
                                                 options.gradient_tolerance);
    RenderedFeatures rays =
        options.orbits.defined()
            ? layers_->field->render_tracked(
                  tracked_points(options.orbits, cameras, sampling, samples.depths), points, style)
            : layers_->field->render(points, style, options.keep_field);
    const std::int64_t side = sampling.rays_per_side;
    const Variable features = layers_->images->feature_values(rays.features);
    Decoded decoded = decode_feature_map(
        reshape(features, {w.batch(), side, side, features.shape(2)}), w, options);
    if (options.mask && !decoded.mask_logit.defined())
        decoded.mask_logit = layers_->images->mask_of_rays(rays.weights.transmittance, side);
    decoded.weights = std::move(rays.weights);
    decoded.samples = std::move(samples);
    return decoded;
}

Decoded Decoder::decode_feature_map(const Variable& feature_map, const Codes& w,
                                    const DecodeOptions& options) const {
    const std::int64_t side =
        layers_->sampling_of(options.samples_per_ray, options.resolution).rays_per_side;
    const std::int64_t channels = layers_->images->channels();
    if (!(feature_map.shape() == Shape{w.batch(), side, side, channels})) {
        fail<ShapeError>("feature map must be (", w.batch(), ", ", side, ", ", side, ", ", channels,
                         "), got ", feature_map.shape());
    }
    return layers_->images->images(feature_map, appearance_style(w), options);
}

Tensor Decoder::compositing_weights(const Codes& z, const std::vector<Camera>& cameras,
                                    std::int64_t samples_per_ray, std::int64_t resolution) const {
    const Codes w = detached(map(z));
    const RaySamples samples =
        layers_->samples_of(w, cameras, layers_->sampling_of(samples_per_ray, resolution), nullptr);
    return layers_->weights_of(samples, w);
}

Variable Decoder::density(const Variable& points, const Codes& w) const {
    return layers_->field->density(points, field_style(w));
}

DecoderWork Decoder::work(std::int64_t resolution) const {
    const std::int64_t side = layers_->sampling_of(2, resolution).rays_per_side;
    return {.rays = side * side,
            .field = layers_->field->work(),
            .blocks = layers_->images->multiply_adds(resolution)};
}

LayerMemory Decoder::memory(const DecodeOptions& options, std::int64_t images) const {
    const RaySampling sampling = layers_->sampling_of(options.samples_per_ray, options.resolution);
    const std::int64_t rays = images * sampling.rays_per_side * sampling.rays_per_side;
    LayerMemory memory = layers_->field->memory(rays, options.samples_per_ray, options.keep_field);
    memory.add(layers_->images->memory(options, images));
    return memory;
}

bool Decoder::folds() const {
    return layers_->field->folds();
}

FoldedField Decoder::folded_field(const Codes& w) const {
    return layers_->field->folded(field_style(w));
}

std::vector<FoldedRenderBlock> Decoder::folded_blocks(const Codes& w,
                                                      std::int64_t resolution) const {
    return layers_->images->folded_blocks(appearance_style(w), resolution);
}

FoldedMaskBranch Decoder::folded_mask() const {
    return layers_->images->folded_mask();
}

}  // namespace stymo
