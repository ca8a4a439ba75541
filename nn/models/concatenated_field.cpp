#include "nn/models/concatenated_field.h"

#include <algorithm>
#include <numbers>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/models/significant_rows.h"
#include "render/encoding.h"

namespace stymo {
namespace {

/// Samples that are computed at once: enough for full matrix products, few enough for the caches.
constexpr std::int64_t samples_at_once = 2048;

LinearOptions before_relu() {
    return {.gain = std::numbers::sqrt2};
}

/// A layer with the input [first, code, rest]. The code is the same at all samples of a face, so
/// its product is added to the bias.
Variable joined(const Linear& layer, const std::vector<Variable>& first_and_rest,
                const Variable& code) {
    const Variable weight = layer.effective_weight();
    const std::int64_t out = weight.shape(0), in = weight.shape(1);
    const std::int64_t begin = first_and_rest.front().shape(2), end = begin + code.shape(1);
    const Variable code_weight = slice(weight, 1, begin, end);
    const Variable bias =
        layer.effective_bias() + reshape(matmul(code, code_weight, {.transpose_b = true}), {out});
    Variable rest = slice(weight, 1, 0, begin);
    if (end < in) rest = concat({rest, slice(weight, 1, end, in)}, 1);
    const Variable x =
        first_and_rest.size() == 1 ? first_and_rest.front() : concat(first_and_rest, 2);
    return linear(x, reshape(rest, {1, out, in - code.shape(1)}), bias);
}

std::int64_t feature_width(const FieldConfig& config) {
    return std::max<std::int64_t>(1, config.width / 2);
}

/// Rows of face `face`.
Variable of_face(const Variable& x, std::int64_t face) {
    return x.shape(0) == 1 ? x : slice(x, 0, face, face + 1);
}
Tensor of_rays(const Tensor& values, std::int64_t face, std::int64_t begin, std::int64_t end) {
    if (!values.defined()) return {};
    return slice(of_face(values, face), 1, begin, end).value();
}

}  // namespace

ConcatenatedField::ConcatenatedField(const FieldConfig& config, ParameterStore& store,
                                     const std::string& prefix, Rng& rng)
    : config_(config),
      encoding_size_(encoded_channels(config.frequencies)),
      density_(store, prefix + ".density", config.width, 1, {}, rng),
      feature0_(store, prefix + ".feature0", config.width, config.width, {}, rng),
      feature1_(store, prefix + ".feature1", config.width + config.appearance_size,
                feature_width(config), before_relu(), rng),
      feature2_(store, prefix + ".feature2", feature_width(config), config.channels, {}, rng) {
    if (config.layers < 1)
        fail<ValueError>("radiance field ", prefix, " needs at least one layer, got ",
                         config.layers);
    const std::int64_t entering = encoding_size_ + config.geometry_size;
    for (std::int64_t i = 0; i < config.layers; ++i) {
        const bool again = i > 0 && i == skip_layer_of(config.layers);
        const std::int64_t in = i == 0 ? entering : config.width + (again ? entering : 0);
        layers_.emplace_back(store, prefix + ".layer" + std::to_string(i), in, config.width,
                             before_relu(), rng);
    }
}

Variable ConcatenatedField::trunk(const Variable& points, const Variable& geometry) const {
    const Variable encoding = positional_encoding(points, config_.frequencies);
    const auto skip = static_cast<std::size_t>(skip_layer_of(config_.layers));
    Variable x = relu(joined(layers_.front(), {encoding}, geometry));
    for (std::size_t i = 1; i < layers_.size(); ++i)
        x = relu(i == skip ? joined(layers_[i], {encoding, x}, geometry) : layers_[i](x));
    return x;
}

Variable ConcatenatedField::density_of(const Variable& trunk) const {
    return softplus(density_(trunk) - 1.0);
}

Variable ConcatenatedField::features_of(const Variable& trunk, const Variable& appearance) const {
    const Variable features = relu(joined(feature1_, {feature0_(trunk)}, appearance));
    return config_.colors ? sigmoid(feature2_(features)) : features;
}

Variable ConcatenatedField::samples(const Variable& points, const FieldStyle& style) const {
    const Variable x = trunk(reshape(points, {1, points.shape(0), 3}), style.geometry);
    return reshape(concat({density_of(x), features_of(x, style.appearance)}, 2),
                   {points.shape(0), -1});
}

Variable ConcatenatedField::composited(const Variable& points, const RayPoints& rays,
                                       const FieldStyle& style) const {
    const std::int64_t count = rays.deltas.shape(1), per_ray = rays.deltas.shape(2);
    const Variable all = reshape(points, {count * per_ray, 3});
    if (!rays.significant.defined()) {
        const Variable values = samples(all, style);
        const CompositeWeights weights =
            composite_weights(reshape(slice(values, 1, 0, 1), rays.deltas.shape()), rays.deltas);
        const Variable features =
            reshape(slice(values, 1, 1, values.shape(1)), {1, count * per_ray, -1});
        return concat(
            {weights.weights, weights.transmittance, composite(weights.weights, features)}, 2);
    }
    const RowIndices rows = significant_rows(rays, 0);
    if (rows.empty()) {
        // No sample is significant: all rays are transparent.
        const std::int64_t width = config_.colors ? config_.channels : feature_width(config_);
        const DType dtype = rays.deltas.dtype();
        return concat(
            {Tensor::zeros({1, count, per_ray}, dtype), Tensor::full({1, count, 1}, 1.0, dtype),
             Tensor::zeros({1, count, width}, dtype)},
            2);
    }
    const RenderedRays result =
        composited_rows(samples(gather_rows(all, rows), style), rows, rays.deltas);
    return concat({result.weights.weights, result.weights.transmittance, result.composited}, 2);
}

RenderedFeatures ConcatenatedField::render_tracked(const Variable& points, const RayPoints& rays,
                                                   const FieldStyle& style) const {
    const std::int64_t count = rays.deltas.shape(1), per_ray = rays.deltas.shape(2);
    const std::int64_t at_once = std::max<std::int64_t>(1, samples_at_once / per_ray);
    std::vector<Variable> faces;
    for (std::int64_t face = 0; face < rays.deltas.shape(0); ++face) {
        const Variable own = of_face(points, face);
        const std::vector<Variable> codes{of_face(style.geometry, face),
                                          of_face(style.appearance, face)};
        std::vector<Variable> tiles;
        for (std::int64_t begin = 0; begin < count; begin += at_once) {
            const std::int64_t end = std::min(count, begin + at_once);
            const RayPoints tile{{},
                                 of_rays(rays.deltas, face, begin, end),
                                 of_rays(rays.significant, face, begin, end)};
            tiles.push_back(recompute(
                [field = *this, tile](std::span<const Variable> inputs) {
                    return field.composited(inputs[0], tile, {inputs[1], inputs[2]});
                },
                {slice(own, 1, begin * per_ray, end * per_ray), codes[0], codes[1]}));
        }
        faces.push_back(concat(tiles, 1));
    }
    const Variable result = concat(faces, 0);
    RenderedFeatures rendered{
        {slice(result, 2, 0, per_ray), slice(result, 2, per_ray, per_ray + 1)},
        slice(result, 2, per_ray + 1, result.shape(2))};
    if (config_.colors) return rendered;
    // W sum_i w_i f_i + b sum_i w_i, as in RadianceField::apply_last_layer.
    const Variable weight = feature2_.effective_weight();
    rendered.features =
        linear(rendered.features, reshape(weight, {1, weight.shape(0), weight.shape(1)}), {}) +
        sum(rendered.weights.weights, {2}) * feature2_.effective_bias();
    return rendered;
}

RenderedFeatures ConcatenatedField::render(const RayPoints& rays, const FieldStyle& style,
                                           bool) const {
    return render_tracked(rays.points, rays, style);
}

Variable ConcatenatedField::density(const Variable& points, const FieldStyle& style) const {
    std::vector<Variable> faces;
    for (std::int64_t face = 0; face < points.shape(0); ++face)
        faces.push_back(density_of(trunk(of_face(points, face), of_face(style.geometry, face))));
    return concat(faces, 0);
}

FieldWork ConcatenatedField::work() const {
    FieldWork work{.sample = density_.multiply_adds() + feature0_.multiply_adds() +
                             feature1_.multiply_adds() -
                             feature_width(config_) * config_.appearance_size};
    (config_.colors ? work.sample : work.ray) += feature2_.multiply_adds();
    for (const Linear& layer : layers_) work.sample += layer.multiply_adds();
    const std::int64_t readers = skip_layer_of(config_.layers) > 0 ? 2 : 1;
    work.sample -= readers * config_.width * config_.geometry_size;
    return work;
}

LayerMemory ConcatenatedField::memory(std::int64_t rays, std::int64_t samples_per_ray, bool) const {
    // Saved: points, distances, depths and weights of all rays with their gradients. Passing: the
    // layers of one tile of samples, and the sums of weight gradients.
    const std::int64_t composited = config_.colors ? config_.channels : feature_width(config_);
    const std::int64_t layers = (std::ssize(layers_) + 4) * config_.width;
    return {rays * (2 * (composited + samples_per_ray) + 8 * samples_per_ray),
            samples_at_once * layers + 4 * config_.width * layers};
}

}  // namespace stymo
