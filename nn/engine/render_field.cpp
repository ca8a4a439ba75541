#include "nn/engine/render_field.h"

#include <algorithm>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/work_counts.h"
#include "nn/engine/rays_of_face.h"
#include "render/composite.h"

namespace stymo {

namespace {

/// `arguments`: those of this face, or null if they are not kept.
template <class T>
void render_run(const PackedField<T>& field, const FaceSamples<T>& samples,
                const RayExtents& extents, std::int64_t first, std::int64_t end, T* arguments,
                T* result) {
    RayTile<T> tile;
    for_each_tile(samples, extents, first, end, tile, [&] {
        SineArgumentRows<T> kept;
        if (arguments != nullptr) {
            kept = {arguments + tile.first_ray * extents.samples * extents.width,
                    extents.layer_arguments()};
        }
        field.evaluate(tile.points, tile.field, kept);
        tile.composite(samples.selection, samples);
        field.features(tile.count(), tile.field, kept);
        for (std::int64_t ray = tile.first_ray; ray < tile.end_ray; ++ray) {
            T* row = result + ray * extents.columns();
            std::fill_n(row, extents.columns(), T(0));
            const T* features = tile.field.features.data() + tile.begin_of(ray) * extents.width;
            auto at = static_cast<std::size_t>(tile.begin_of(ray));
            for (const std::int32_t sample : samples.selection.samples_of(ray)) {
                row[sample] = tile.weights[at];
                add_weighted(row + extents.samples + 1, tile.weights[at], features, extents.width);
                features += extents.width;
                ++at;
            }
            row[extents.samples] = tile.transmittance_of(ray);
        }
    });
}

}  // namespace

FieldPassResult render_field_forward(const RayPoints& rays, const SineNetworkOf<Tensor>& network,
                                     bool keep_arguments) {
    const RayExtents extents(rays, network);
    FieldPassResult result{
        Tensor({extents.faces, extents.rays, extents.columns()}, rays.deltas.dtype()), {}};
    if (keep_arguments) {
        result.arguments =
            Tensor({extents.faces, extents.layers, extents.rays * extents.samples, extents.width},
                   rays.deltas.dtype());
    }
    dispatch(result.value.dtype(), [&]<class T>(T) {
        T* const values = result.value.mutable_values<T>().data();
        T* const arguments = keep_arguments ? result.arguments.mutable_values<T>().data() : nullptr;
        for (std::int64_t face = 0; face < extents.faces; ++face) {
            const PackedField<T> field(folded(network, face));
            const FaceSamples<T> samples(rays, extents, face);
            for_each_run(extents, [&](std::int64_t first, std::int64_t end, std::int64_t) {
                render_run(field, samples, extents, first, end,
                           keep_arguments ? arguments + face * extents.face_arguments() : nullptr,
                           values + face * extents.rays * extents.columns());
            });
        }
    });
    return result;
}

namespace {

/// Calls f(part) for each part of a network, in the order of the node's inputs.
template <class Network, class Function>
void visit(Network& network, Function f) {
    for (auto& layer : network.layers) {
        f(layer.weight);
        f(layer.scale);
        f(layer.demodulation);
        f(layer.bias);
    }
    f(network.density_weight);
    f(network.density_bias);
}

template <class Value>
std::vector<Value> parts_of(const SineNetworkOf<Value>& network) {
    std::vector<Value> parts;
    visit(network, [&](const Value& part) { parts.push_back(part); });
    return parts;
}

/// Makes networks of one form from their parts, the inverse of `parts_of`.
struct NetworkForm {
    std::int64_t frequencies;
    std::size_t skip_layer;
    std::size_t layers;

    template <class Value>
    [[nodiscard]] SineNetworkOf<Value> operator()(const std::vector<Value>& parts) const {
        SineNetworkOf<Value> network{.frequencies = frequencies,
                                     .skip_layer = skip_layer,
                                     .layers = std::vector<ModulatedLayerOf<Value>>(layers),
                                     .density_weight = {},
                                     .density_bias = {}};
        visit(network, [next = parts.begin()](Value& part) mutable { part = *next++; });
        return network;
    }
};

void require(bool fits, const char* what, const Shape& shape) {
    if (!fits)
        fail<ShapeError>("[render_field] ", what, " ", shape,
                         " does not fit the network or its rays");
}

void check(const RayPoints& rays, const SineNetwork& network) {
    require(rays.deltas.rank() == 3, "deltas", rays.deltas.shape());
    require_ordered_samples("render_field", rays.deltas);
    const std::int64_t batch = rays.deltas.shape(0),
                       points = rays.deltas.shape(1) * rays.deltas.shape(2);
    require(rays.points.shape() == Shape{batch, points, 3}, "points", rays.points.shape());
    require(!rays.significant.defined() || rays.significant.shape() == rays.deltas.shape(),
            "significant", rays.significant.shape());
    if (network.layers.size() < 2)
        fail<ShapeError>("[render_field] needs a layer before that of the features");
    if (network.skip_layer + 1 >= network.layers.size())
        fail<ShapeError>("[render_field] the encoding cannot enter at the layer of the features, ",
                         network.skip_layer);
    const std::int64_t width = network.layers.front().bias.shape(0),
                       encoding = 3 + 6 * network.frequencies;
    for (std::size_t i = 0; i < network.layers.size(); ++i) {
        const ModulatedLayer& layer = network.layers[i];
        const std::int64_t in =
            i == 0 ? encoding : width + (i == network.skip_layer ? encoding : 0);
        require(layer.weight.shape() == Shape{1, width, in}, "weight", layer.weight.shape());
        require(layer.scale.shape() == Shape{batch, 1, in}, "scale", layer.scale.shape());
        require(layer.demodulation.shape() == Shape{batch, width, 1}, "demodulation",
                layer.demodulation.shape());
        require(layer.bias.shape() == Shape{width}, "bias", layer.bias.shape());
    }
    require(network.density_weight.shape() == Shape{1, width}, "density weight",
            network.density_weight.shape());
    require(network.density_bias.shape() == Shape{1}, "density bias", network.density_bias.shape());
}

}  // namespace

Variable render_field(const RayPoints& rays, const SineNetwork& network,
                      const FieldComposition& composition, SineArguments arguments) {
    check(rays, network);
    const std::vector<Variable> parts = parts_of(network);
    std::vector<Tensor> values;
    for (const Variable& part : parts) values.push_back(part.value());
    const NetworkForm network_of{network.frequencies, network.skip_layer, network.layers.size()};
    const bool tracked = std::ranges::any_of(parts, &Variable::tracked);
    // With a tolerance the backward pass has few samples. Computing their arguments again is
    // cheaper than storing those of all samples.
    const bool keep = arguments == SineArguments::kept && rays.gradient_tolerance == 0.0;
    FieldPassResult result = render_field_forward(rays, network_of(values), tracked && keep);
    if (!tracked) {
        work::count_operation();
        return Variable(std::move(result.value));
    }

    std::vector<Node::Input> inputs;
    for (const Variable& part : parts) inputs.push_back({part.node(), part.value(), part.shape()});
    const Tensor value = result.value;
    if (rays.gradient_tolerance == 0.0) result.value = {};
    return record("render_field", value, std::move(inputs),
                  [rays, composition, network_of, forward = std::move(result),
                   count = parts.size()](const Vjp& v, const std::vector<bool>& needed) {
                      std::vector<Variable> given;
                      // Each part gets its own node, since one variable may be several parts.
                      for (std::size_t i = 0; i < count; ++i)
                          given.push_back(v.create_graph() ? v.input(i) * 1.0 : v.input(i));
                      std::vector<Variable> gradients(count);
                      if (v.create_graph()) {
                          std::vector<Variable> xs;
                          for (std::size_t i = 0; i < count; ++i)
                              if (needed[i]) xs.push_back(given[i]);
                          const std::vector<Variable> found =
                              grad(composition(rays, network_of(given)), xs,
                                   {.create_graph = true, .partial = true, .dL_dy = v.grad()});
                          for (std::size_t i = 0, next = 0; i < count; ++i)
                              if (needed[i]) gradients[i] = found[next++];
                          return gradients;
                      }
                      const bool with_weights = std::ranges::any_of(
                          network_of(needed).layers, &ModulatedLayerOf<bool>::weight);
                      std::vector<Tensor> constants;
                      for (const Variable& part : given) constants.push_back(part.value());
                      const std::vector<Tensor> found = parts_of(render_field_backward(
                          rays, network_of(constants), forward, v.grad().value(), with_weights));
                      for (std::size_t i = 0; i < count; ++i)
                          if (needed[i]) gradients[i] = Variable(found[i]);
                      return gradients;
                  });
}

}  // namespace stymo
