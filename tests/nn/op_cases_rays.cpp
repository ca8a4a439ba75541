#include <cmath>

#include "core/op_cases.h"
#include "core/ops/ops.h"
#include "nn/engine/render_field.h"
#include "render/composite.h"
#include "render/encoding.h"

namespace stymo::test {
namespace {

constexpr std::int64_t frequencies = 1;
constexpr std::size_t skip_layer = 1;
constexpr std::size_t layer_count = 3;

struct Sizes {
    std::int64_t faces, width, rays, samples;
};

/// Few rays with few channels, a tile and more with many.
Sizes sizes_of(std::int64_t faces, std::int64_t width) {
    return width < 16 ? Sizes{faces, width, 2, 3} : Sizes{faces, width, 40, 8};
}

RayPoints ray_points(const Sizes& sizes, bool some_left_out, DType dtype) {
    const auto [faces, width, rays, samples] = sizes;
    RayPoints result{constant({faces, rays * samples, 3}, -1.0, 1.0, dtype),
                     constant({faces, rays, samples}, 0.1, 0.5, dtype)};
    if (!some_left_out) return result;
    // Of one ray nothing is left.
    Tensor kept({faces, rays, samples}, DType::float64);
    std::int64_t i = 0;
    for (double& value : kept.mutable_values<double>())
        value = i < samples || i % 4 == 1 ? 0.0 : 1.0, ++i;
    result.significant = kept.to(dtype);
    return result;
}

template <class Value>
SineNetworkOf<Value> network_of(const std::vector<Value>& x) {
    SineNetworkOf<Value> network{.frequencies = frequencies,
                                 .skip_layer = skip_layer,
                                 .layers = {},
                                 .density_weight = x[4 * layer_count],
                                 .density_bias = x[4 * layer_count + 1]};
    for (std::size_t i = 0; i < 4 * layer_count; i += 4)
        network.layers.push_back({x[i], x[i + 1], x[i + 2], x[i + 3]});
    return network;
}

Variable composed(const RayPoints& rays, const SineNetwork& network) {
    const auto layer = [&](const Variable& x, const ModulatedLayer& part) {
        const Variable y = matmul(x * part.scale, part.weight, {.transpose_b = true});
        return sin(y * reshape(part.demodulation, {part.demodulation.shape(0), 1, -1}) + part.bias);
    };
    const Variable encoding = positional_encoding(rays.points, frequencies);
    const Variable x =
        layer(concat({encoding, layer(encoding, network.layers[0])}, 2), network.layers[1]);
    const Variable logit = sum(x * network.density_weight, {2}) + network.density_bias;
    Variable density = reshape(softplus(logit - 1.0), rays.deltas.shape());
    if (rays.significant.defined()) density = density * Variable(rays.significant);
    const CompositeWeights weights = composite_weights(density, rays.deltas);
    return concat({weights.weights, weights.transmittance,
                   composite(weights.weights, layer(x, network.layers[2]))},
                  2);
}

/// One point's output of a layer.
std::vector<double> layer_of(const std::vector<double>& x, const ModulatedLayerOf<Array>& layer,
                             std::int64_t face) {
    std::vector<double> y;
    for (std::int64_t o = 0; o < layer.bias.extent(0); ++o) {
        double z = layer.bias.at({o});
        for (std::size_t i = 0; i < x.size(); ++i) {
            const auto in = static_cast<std::int64_t>(i);
            z += layer.demodulation.at({face, o, 0}) * layer.weight.at({0, o, in}) *
                 layer.scale.at({face, 0, in}) * x[i];
        }
        y.push_back(std::sin(z));
    }
    return y;
}

Array by_loops(const std::vector<Array>& x, bool some_left_out) {
    const SineNetworkOf<Array> network = network_of(x);
    const Sizes sizes = sizes_of(x[1].extent(0), x[0].extent(1));
    const RayPoints rays = ray_points(sizes, some_left_out, DType::float64);
    const Array points = to_array(rays.points), deltas = to_array(rays.deltas);
    const std::int64_t samples = sizes.samples;
    Array result = generate({sizes.faces, sizes.rays, samples + 1 + sizes.width},
                            [](const Index&) { return 0.0; });
    for_each_index({sizes.faces, sizes.rays}, [&](const Index& at) {
        double transmittance = 1.0;
        for (std::int64_t sample = 0; sample < samples; ++sample) {
            if (some_left_out && to_array(rays.significant).at({at[0], at[1], sample}) == 0.0)
                continue;
            std::vector<double> encoding;
            for (double (*function)(double) :
                 {+[](double v) { return v; }, +[](double v) { return std::sin(v); },
                  +[](double v) { return std::cos(v); }}) {
                for (std::int64_t axis = 0; axis < 3; ++axis)
                    encoding.push_back(
                        function(points.at({at[0], at[1] * samples + sample, axis})));
            }
            std::vector<double> joined = encoding;
            const std::vector<double> first = layer_of(encoding, network.layers[0], at[0]);
            joined.insert(joined.end(), first.begin(), first.end());
            const std::vector<double> last = layer_of(joined, network.layers[1], at[0]);
            double logit = network.density_bias.at({0});
            for (std::size_t i = 0; i < last.size(); ++i)
                logit += last[i] * network.density_weight.at({0, static_cast<std::int64_t>(i)});
            const double density = std::log1p(std::exp(logit - 1.0));
            const double weight =
                transmittance * (1.0 - std::exp(-density * deltas.at({at[0], at[1], sample})));
            transmittance -= weight;
            result.at({at[0], at[1], sample}) = weight;
            const std::vector<double> features = layer_of(last, network.layers[2], at[0]);
            for (std::size_t i = 0; i < features.size(); ++i)
                result.at({at[0], at[1], samples + 1 + static_cast<std::int64_t>(i)}) +=
                    weight * features[i];
        }
        result.at({at[0], at[1], samples}) = transmittance;
    });
    return result;
}

std::vector<Shape> shapes(std::int64_t faces, std::int64_t width) {
    const std::int64_t encoding = 3 + 6 * frequencies;
    std::vector<Shape> all;
    for (const std::int64_t in : {encoding, encoding + width, width}) {
        for (const Shape& shape :
             {Shape{1, width, in}, Shape{faces, 1, in}, Shape{faces, width, 1}, Shape{width}})
            all.push_back(shape);
    }
    all.push_back({1, width});
    all.push_back({1});
    return all;
}

}  // namespace

std::vector<OpCase> rays_cases() {
    std::vector<OpCase> rows;
    for (const bool some_left_out : {false, true}) {
        std::vector<CaseInput> inputs;
        for (const Shape& shape : shapes(2, 3)) {
            const bool factor = shape.rank() == 3 && shape[0] == 2;
            inputs.push_back({shape, factor ? 0.5 : -1.0, factor ? 1.5 : 1.0});
        }
        rows.push_back({"render_field", some_left_out ? "samples left out" : "every sample", inputs,
                        [=](const std::vector<Variable>& x) {
                            const RayPoints rays =
                                ray_points(sizes_of(x[1].shape(0), x[0].shape(1)), some_left_out,
                                           x[0].dtype());
                            return render_field(rays, network_of(x), composed);
                        },
                        [=](const std::vector<Array>& x) { return by_loops(x, some_left_out); },
                        shapes(2, 48)});
    }
    return rows;
}

}  // namespace stymo::test
