#include "nn/models/radiance_field.h"

#include <algorithm>
#include <cmath>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/activation.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"
#include "core/work_counts.h"
#include "nn/models/significant_rows.h"
#include "render/encoding.h"

namespace stymo {
namespace {

Variable sine_layer(const Variable& x, const ModulatedLayer& layer) {
    return linear(x, layer.weight * layer.scale * layer.demodulation, layer.bias, Activation::sine);
}

FieldSamples evaluate(const Variable& points, const SineNetwork& network, bool density_only) {
    work::count_field_points(points.shape(0) * points.shape(1));
    const Variable encoding = positional_encoding(points, network.frequencies);
    Variable x = encoding;
    for (std::size_t i = 0; i + 1 < network.layers.size(); ++i)
        x = sine_layer(i > 0 && i == network.skip_layer ? concat({encoding, x}, 2) : x,
                       network.layers[i]);
    const Variable density_weight = reshape(network.density_weight, {1, 1, -1});
    FieldSamples samples{softplus(linear(x, density_weight, network.density_bias) - 1.0), {}};
    if (!density_only) samples.features = sine_layer(x, network.layers.back());
    return samples;
}

Variable render_by_ops(const RayPoints& rays, const SineNetwork& network) {
    const FieldSamples samples = evaluate(rays.points, network, false);
    Variable density = reshape(samples.density, rays.deltas.shape());
    if (rays.significant.defined()) density = density * Variable(rays.significant);
    const CompositeWeights weights = composite_weights(density, rays.deltas);
    return concat(
        {weights.weights, weights.transmittance, composite(weights.weights, samples.features)}, 2);
}

/// Factors on a layer's initial weights: columns of frequency 2^k are multiplied by 2^(-k *
/// falloff).
Tensor initial_scale(std::int64_t frequencies, double falloff, std::int64_t inputs) {
    constexpr std::int64_t plain = 3, per_frequency = 6;
    Tensor scale = Tensor::full({inputs}, 1.0);
    const std::span<float> values = scale.mutable_values<float>();
    for (std::int64_t i = 0; i < per_frequency * frequencies; ++i)
        values[static_cast<std::size_t>(plain + i)] =
            static_cast<float>(std::exp2(-falloff * static_cast<double>(i / per_frequency)));
    return scale;
}

SineNetworkOf<Tensor> values_of(const SineNetwork& network) {
    SineNetworkOf<Tensor> values{.frequencies = network.frequencies,
                                 .skip_layer = network.skip_layer,
                                 .layers = {},
                                 .density_weight = network.density_weight.value(),
                                 .density_bias = network.density_bias.value()};
    for (const ModulatedLayer& layer : network.layers) {
        values.layers.push_back({layer.weight.value(), layer.scale.value(),
                                 layer.demodulation.value(), layer.bias.value()});
    }
    return values;
}

RenderedRays split_result(const Variable& rays, std::int64_t samples) {
    return {{slice(rays, 2, 0, samples), slice(rays, 2, samples, samples + 1)},
            slice(rays, 2, samples + 1, rays.shape(2))};
}

}  // namespace

RadianceField::RadianceField(const RadianceFieldConfig& config, ParameterStore& store,
                             const std::string& prefix, Rng& rng)
    : frequencies_(config.frequencies),
      skip_layer_(static_cast<std::size_t>(skip_layer_of(config.layers))),
      density_(store, prefix + ".density", config.width, 1, {}, rng),
      feature0_(store, prefix + ".feature0", config.width, config.width, config.style_size,
                Activation::sine, rng),
      feature1_(store, prefix + ".feature1", config.width, config.feature_channels, {}, rng) {
    if (config.layers < 1)
        fail<ValueError>("radiance field ", prefix, " needs at least one layer, got ",
                         config.layers);
    const std::int64_t encoding = encoded_channels(config.frequencies);
    for (std::int64_t i = 0; i < config.layers; ++i) {
        const bool joined = i > 0 && i == skip_layer_of(config.layers);
        const std::int64_t in = i == 0 ? encoding : config.width + (joined ? encoding : 0);
        const bool encoded = i == 0 || joined;
        layers_.emplace_back(
            store, prefix + ".layer" + std::to_string(i), in, config.width, config.style_size,
            Activation::sine, rng,
            encoded ? initial_scale(config.frequencies, config.frequency_falloff, in) : Tensor());
    }
}

SineNetwork RadianceField::network(const Variable& style) const {
    SineNetwork network{.frequencies = frequencies_,
                        .skip_layer = skip_layer_,
                        .layers = {},
                        .density_weight = density_.effective_weight(),
                        .density_bias = density_.effective_bias()};
    for (const ModulatedLinear& layer : layers_) network.layers.push_back(layer.parts(style));
    network.layers.push_back(feature0_.parts(style));
    return network;
}

FieldSamples RadianceField::operator()(const Variable& points, const Variable& style,
                                       bool density_only) const {
    if (points.rank() != 3 || points.shape(2) != 3)
        fail<ShapeError>("radiance field: expected points (B, P, 3), got ", points.shape());
    return evaluate(points, network(style), density_only);
}

RenderedRays RadianceField::render(const RayPoints& rays, const Variable& style,
                                   SineArguments arguments) const {
    return split_result(render_field(rays, network(style), render_by_ops, arguments),
                        rays.deltas.shape(2));
}

RenderedRays RadianceField::render_reference(const RayPoints& rays, const Variable& style) const {
    return split_result(render_by_ops(rays, network(style)), rays.deltas.shape(2));
}

Variable RadianceField::tracked_samples(const Variable& points, const Variable& style) const {
    constexpr std::int64_t rows_at_once = 8192;
    std::vector<Variable> parts;
    for (std::int64_t begin = 0; begin < points.shape(0); begin += rows_at_once) {
        const std::int64_t end = std::min(begin + rows_at_once, points.shape(0));
        parts.push_back(recompute(
            [field = *this](std::span<const Variable> inputs) {
                const std::int64_t rows = inputs[0].shape(0);
                const FieldSamples samples =
                    evaluate(reshape(inputs[0], {1, rows, 3}), field.network(inputs[1]), false);
                return reshape(concat({samples.density, samples.features}, 2), {rows, -1});
            },
            {slice(points, 0, begin, end), style}));
    }
    return concat(parts, 0);
}

RenderedRays RadianceField::render_tracked(const Variable& points, const RayPoints& rays,
                                           const Variable& style) const {
    std::vector<Variable> weights, transmittance, sums;
    for (std::int64_t face = 0; face < points.shape(0); ++face) {
        // The ops cannot compute with zero rows.
        RowIndices rows = significant_rows(rays, face);
        if (rows.empty()) rows.push_back(0);
        const Variable own = reshape(slice(points, 0, face, face + 1), {points.shape(1), 3});
        const Variable samples =
            tracked_samples(gather_rows(own, rows), slice(style, 0, face, face + 1));
        RenderedRays rendered =
            composited_rows(samples, rows, slice(Variable(rays.deltas), 0, face, face + 1).value());
        weights.push_back(rendered.weights.weights);
        transmittance.push_back(rendered.weights.transmittance);
        sums.push_back(rendered.composited);
    }
    return {{concat(weights, 0), concat(transmittance, 0)}, concat(sums, 0)};
}

FoldedField RadianceField::folded(const Variable& style) const {
    if (style.rank() != 2 || style.shape(0) != 1)
        fail<ShapeError>("a field is folded for the style of one face, (1, size), got ",
                         style.shape());
    FoldedField field = stymo::folded(values_of(network(style)), 0);
    field.feature1 = feature1_.folded();
    return field;
}

RenderedFeatures RadianceField::with_last_layer(RenderedRays rays) const {
    const Variable features = apply_last_layer(rays.composited, sum(rays.weights.weights, {2}));
    return {std::move(rays.weights), features};
}

RenderedFeatures RadianceField::render(const RayPoints& rays, const FieldStyle& style,
                                       bool keep) const {
    return with_last_layer(
        render(rays, style.geometry, keep ? SineArguments::kept : SineArguments::recomputed));
}

RenderedFeatures RadianceField::render_tracked(const Variable& points, const RayPoints& rays,
                                               const FieldStyle& style) const {
    return with_last_layer(render_tracked(points, rays, style.geometry));
}

Variable RadianceField::density(const Variable& points, const FieldStyle& style) const {
    return (*this)(points, style.geometry, true).density;
}

FoldedField RadianceField::folded(const FieldStyle& style) const {
    return folded(style.geometry);
}

FieldWork RadianceField::work() const {
    FieldWork work{.sample = density_.multiply_adds() + feature0_.multiply_adds(),
                   .ray = feature1_.multiply_adds()};
    for (const ModulatedLinear& layer : layers_) work.sample += layer.multiply_adds();
    return work;
}

Variable RadianceField::apply_last_layer(const Variable& composited,
                                         const Variable& opacity) const {
    const Variable weight = feature1_.effective_weight();
    const Variable product =
        linear(composited, reshape(weight, {1, weight.shape(0), weight.shape(1)}), {});
    return product + opacity * feature1_.effective_bias();
}

LayerMemory RadianceField::memory(std::int64_t rays, std::int64_t samples_per_ray,
                                  bool keep) const {
    // Runs that have their own sums of weight gradients; faces are computed one after the other.
    constexpr std::int64_t sums = 16;
    const std::int64_t width = density_.inputs();
    const std::int64_t arguments = keep ? samples_per_ray * width * (std::ssize(layers_) + 1) : 0;
    // Samples, results and their gradients, and the arguments of the sines.
    return {rays * (3 * (width + samples_per_ray) + 5 * samples_per_ray + arguments),
            sums * work().sample};
}

}  // namespace stymo
