#include "nn/layer_cases.h"

#include <array>
#include <memory>

#include "core/ops/ops.h"
#include "nn/layers/batch_norm.h"
#include "nn/layers/conv_layer.h"
#include "nn/layers/discriminator_block.h"
#include "nn/layers/mapping.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/modulated_linear.h"
#include "nn/layers/render_block.h"
#include "nn/losses.h"

namespace stymo::test {
namespace {

using Inputs = std::vector<Variable>;

/// A function of the inputs that owns `layer`.
template <class Layer, class Body>
LayerFunction with(Layer layer, Body body) {
    return [layer = std::make_shared<Layer>(std::move(layer)), body](const Inputs& x) -> Variable {
        return body(*layer, x);
    };
}

Tensor uniform(const Shape& shape) {
    return Rng(3).uniform(shape, 0.0, 1.0, DType::float64);
}

/// 1 and 0 in turn.
Tensor checkered(const Shape& shape) {
    Tensor result = Tensor::zeros(shape, DType::float64);
    const auto values = result.mutable_values<double>();
    for (std::size_t i = 0; i < values.size(); i += 2) values[i] = 1.0;
    return result;
}

LayerFunction modulated(ParameterStore& store, Rng& rng, Activation activation) {
    return with(ModulatedLinear(store, "layer", 5, 4, 3, activation, rng),
                [](const auto& f, const Inputs& x) { return f(x[0], x[1]); });
}

std::vector<LayerCase> make_layers() {
    return {
        {"linear on rows",
         "linear",
         {{3, 5}},
         {3, 4},
         [](ParameterStore& store, Rng& rng) {
             const LinearOptions options{.activation = Activation::leaky_relu,
                                         .learning_rate_multiplier = 0.1,
                                         .initial_bias = 0.5};
             return with(Linear(store, "layer", 5, 4, options, rng),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"linear on an image",
         "linear",
         {{2, 3, 2, 5}},
         {2, 3, 2, 4},
         [](ParameterStore& store, Rng& rng) {
             return with(Linear(store, "layer", 5, 4, {}, rng),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"modulated sine layer",
         "modulated_linear",
         {{2, 6, 5}, {2, 3}},
         {2, 6, 4},
         [](ParameterStore& store, Rng& rng) { return modulated(store, rng, Activation::sine); }},
        {"modulated leaky ReLU layer",
         "modulated_linear",
         {{2, 6, 5}, {2, 3}},
         {2, 6, 4},
         [](ParameterStore& store, Rng& rng) {
             return modulated(store, rng, Activation::leaky_relu);
         }},
        {"modulated linear layer",
         "modulated_linear",
         {{2, 2, 3, 5}, {2, 3}},
         {2, 2, 3, 4},
         [](ParameterStore& store, Rng& rng) { return modulated(store, rng, Activation::none); }},
        {"mapping network",
         "mapping",
         {{3, 7}},
         {3, 7},
         [](ParameterStore& store, Rng& rng) {
             return with(Mapping(store, "mapping", 7, 3, 0.1, rng),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"upsampler",
         "upsampler",
         {{2, 3, 4, 5}},
         {2, 6, 8, 5},
         [](ParameterStore& store, Rng& rng) {
             return with(Upsampler(store, "upsampler", 5, rng),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"upsampling of an RGB image",
         "upsampler",
         {{2, 3, 4, 3}},
         {2, 6, 8, 3},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return upsample_smoothly(x[0]); };
         }},
        {"first render block",
         "render_block",
         {{2, 3, 3, 5}, {2, 6}},
         {2, 6, 6, 3},
         [](ParameterStore& store, Rng& rng) {
             return with(RenderBlock(store, "block", 5, 4, 6, rng),
                         [](const auto& f, const Inputs& x) {
                             return f({x[0], {}}, x[1]).rgb;
                         });
         }},
        {"later render block",
         "render_block",
         {{2, 3, 3, 5}, {2, 3, 3, 3}, {2, 6}},
         {2, 6, 6, 7},
         [](ParameterStore& store, Rng& rng) {
             return with(RenderBlock(store, "block", 5, 4, 6, rng),
                         [](const auto& f, const Inputs& x) {
                             const Rendered rendered = f({x[0], x[1]}, x[2]);
                             return concat({rendered.features, rendered.rgb}, 3);
                         });
         }},
        {"first plain render block",
         "plain_render_block",
         {{2, 3, 3, 5}},
         {2, 6, 6, 3},
         [](ParameterStore& store, Rng& rng) {
             return with(PlainRenderBlock(store, "block", 5, 4, true, rng),
                         [](const auto& f, const Inputs& x) {
                             return f({x[0], {}}, {}).rgb;
                         });
         }},
        {"later plain render block",
         "plain_render_block",
         {{2, 3, 3, 5}, {2, 3, 3, 3}},
         {2, 6, 6, 7},
         [](ParameterStore& store, Rng& rng) {
             return with(PlainRenderBlock(store, "block", 5, 4, false, rng),
                         [](const auto& f, const Inputs& x) {
                             const Rendered rendered = f({x[0], x[1]}, {});
                             return concat({rendered.features, rendered.rgb}, 3);
                         });
         }},
        {"mask branch",
         "mask_branch",
         {{2, 3, 3, 5}, {2, 6, 6, 4}},
         {2, 6, 6, 1},
         [](ParameterStore& store, Rng& rng) {
             const std::array<std::int64_t, 2> channels{5, 4};
             const std::array<std::string, 2> names{"3", "6"};
             return with(MaskBranch(store, "mask", channels, names, 2, rng),
                         [](const auto& f, const Inputs& x) { return f(x); });
         }},
        {"convolution layer",
         "conv_layer",
         {{2, 5, 4, 3}},
         {2, 3, 2, 4},
         [](ParameterStore& store, Rng& rng) {
             return with(ConvLayer(store, "conv", 3, 4,
                                   {.stride = 2, .scaling = WeightScaling::equalised}, rng),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"batch norm",
         "batch_norm",
         {{2, 3, 2, 5}},
         {2, 3, 2, 5},
         [](ParameterStore& store, Rng&) {
             return with(BatchNorm(store, "norm", 5),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"discriminator block",
         "discriminator_block",
         {{2, 6, 4, 3}},
         {2, 3, 2, 5},
         [](ParameterStore& store, Rng& rng) {
             return with(DiscriminatorBlock(store, "block", 3, 5, rng),
                         [](const auto& f, const Inputs& x) { return f(x[0]); });
         }},
        {"minibatch standard deviation",
         "minibatch_deviation",
         {{6, 2, 3, 2}},
         {6, 2, 3, 3},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return append_minibatch_deviation(x[0], 3); };
         }},
    };
}

std::vector<LayerCase> make_losses() {
    return {
        {"photometric loss",
         "photometric_loss",
         {{2, 2, 2, 3}, {2, 4, 4, 3}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 const std::array<Tensor, 2> targets{uniform(x[0].shape()), uniform(x[1].shape())};
                 const std::array<double, 2> weights{0.1, 1.0};
                 return photometric_loss(x, targets, weights);
             };
         }},
        {"code loss",
         "code_loss",
         {{2, 3}, {2, 4}, {2, 2}, {2, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 std::array<Tensor, 4> targets;
                 for (std::size_t i = 0; i < 4; ++i) targets[i] = uniform(x[i].shape());
                 const std::array<double, 4> weights{0.001, 0.1, 0.001, 0.01};
                 return code_loss({{x[0], x[1], x[2], x[3]}}, targets, weights,
                                  Tensor::full({2}, 1.0, DType::float64));
             };
         }},
        {"mask loss",
         "mask_loss",
         {{2, 3, 3, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return mask_loss(x[0], uniform(x[0].shape())); };
         }},
        {"mask loss with unknown pixels",
         "mask_loss",
         {{2, 3, 3, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 return mask_loss(x[0], uniform(x[0].shape()), checkered(x[0].shape()));
             };
         }},
        {"opacity loss with unknown rays",
         "opacity_loss",
         {{2, 9, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 return opacity_loss(sigmoid(x[0]), uniform({2, 3, 3, 1}), checkered({2, 3, 3, 1}));
             };
         }},
        {"opacity loss",
         "opacity_loss",
         {{2, 9, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 return opacity_loss(sigmoid(x[0]), uniform({2, 3, 3, 1}));
             };
         }},
        {"depth loss",
         "depth_loss",
         {{2, 9, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 return depth_loss(x[0], uniform({2, 9}), Tensor::full({18}, 1.0, DType::float64));
             };
         }},
        {"masked mean",
         "masked_mean",
         {{2, 3, 4, 3}},
         {2, 1, 1, 3},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return masked_mean(x[0], uniform({2, 3, 4, 1})); };
         }},
        {"generator loss",
         "generator_loss",
         {{3, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return generator_loss(x[0]); };
         }},
        {"loss of real logits",
         "real_loss",
         {{3, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return real_loss(x[0]); };
         }},
        {"loss of fake logits",
         "fake_loss",
         {{3, 1}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return fake_loss(x[0]); };
         }},
        {"R1 penalty",
         "r1_penalty",
         {{1, 4, 4, 3}},
         {},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) {
                 const auto discriminator = [&x](const Variable& images) {
                     return reshape(sum(tanh(images * x[0]), {1, 2, 3}), {2, 1});
                 };
                 return r1_penalty(discriminator, uniform({2, 4, 4, 3}));
             };
         }},
        {"faded image",
         "faded_image",
         {{2, 4, 4, 3}},
         {2, 4, 4, 3},
         [](ParameterStore&, Rng&) -> LayerFunction {
             return [](const Inputs& x) { return faded_image(x[0], 0.25); };
         }},
    };
}

}  // namespace

const std::vector<LayerCase>& layer_cases() {
    static const std::vector<LayerCase> cases = [] {
        std::vector<LayerCase> all = make_layers();
        for (LayerCase& loss : make_losses()) all.push_back(std::move(loss));
        return all;
    }();
    return cases;
}

}  // namespace stymo::test
