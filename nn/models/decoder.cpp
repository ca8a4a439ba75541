#include "nn/models/decoder.h"

#include <memory>
#include <utility>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/mapping.h"
#include "nn/models/image_stage.h"
#include "nn/models/significant_rows.h"
#include "render/tracked_rays.h"

namespace stymo {
namespace {

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
    config.rays = ray_sampling(config);
    for (std::size_t i = 0; config.mapping_layers > 0 && i < code_names.size(); ++i) {
        mappings.emplace_back(store, prefix + ".mapping." + code_names[i], code_sizes[i],
                              config.mapping_layers, config.mapping_learning_rate_multiplier, rng);
    }
    images = make_image_stage(config, ladder, store, prefix, code_sizes[2] + code_sizes[3], rng);
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
    const std::int64_t side = rays_per_side(options.resolution);
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

std::int64_t Decoder::rays_per_side(std::int64_t resolution) const {
    return layers_->sampling_of(2, resolution).rays_per_side;
}

DecoderWork Decoder::work(std::int64_t resolution) const {
    const std::int64_t side = rays_per_side(resolution);
    return {.rays = side * side,
            .field = layers_->field->work(),
            .blocks = layers_->images->multiply_adds(resolution)};
}

LayerMemory Decoder::memory(const DecodeOptions& options, std::int64_t images) const {
    const RaySampling sampling = layers_->sampling_of(options.samples_per_ray, options.resolution);
    const std::int64_t rays = images * sampling.rays_per_side * sampling.rays_per_side;
    LayerMemory memory = layers_->field->memory(
        rays, options.samples_per_ray, options.keep_field && options.gradient_tolerance == 0.0);
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
