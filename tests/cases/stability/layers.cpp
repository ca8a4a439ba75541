#include "cases/stability/case.h"
#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "nn/layers/batch_norm.h"
#include "nn/layers/discriminator_block.h"
#include "nn/layers/modulated_linear.h"

namespace stymo::stability {

namespace {

/// x, style, weight, and the style layer's bias of a modulated layer, multiplied by these factors.
struct Factors {
    double style = 1.0;
    double weight = 1.0;
    double bias = 1.0;
};

Tensor scaled(const Tensor& x, double factor) {
    return (Variable(x) * factor).value();
}

/// Value of a modulated layer, and its gradients in x, style and every parameter.
StabilityResult modulated(DType dtype, const Factors& factors) {
    ParameterStore store;
    Rng rng(3);
    const ModulatedLinear layer(store, "layer", 6, 5, 4, Activation::leaky_relu, rng);
    const Parameter style_bias = store.all()[1], weight = store.all()[2];
    style_bias.set_value(scaled(style_bias.variable().value(), factors.bias));
    weight.set_value(scaled(weight.variable().value(), factors.weight));
    store.convert(dtype);
    const Tensor style = scaled(rng.normal({2, 4}, 0.0, 1.0), factors.style),
                 x = rng.normal({2, 7, 6}, 0.0, 1.0);
    StabilityResult result =
        differentiate(dtype, {x, style}, [&](const std::vector<Variable>& inputs) {
            return std::vector<Variable>{layer(inputs[0], inputs[1])};
        });
    const Variable y = layer(x.to(dtype), style.to(dtype));
    for (const Variable& gradient : grad(sum(square(y)), variables_of(store.all())))
        result.gradients.push_back(gradient.value());
    return result;
}

std::vector<StabilityCase> demodulation_cases() {
    std::vector<StabilityCase> rows;
    const auto add = [&](std::string name, std::string behaviour, const Factors& factors) {
        rows.push_back({.name = std::move(name),
                        .behaviour = std::move(behaviour),
                        .value_bound = 1e-5,
                        .gradient_bound = 1e-5,
                        .run = [=](DType dtype) { return modulated(dtype, factors); }});
    };
    const std::string epsilon = "1e-8 under the root: the layer gives its bias";
    const std::string units =
        "rows are brought to magnitude 1 before they are squared; the factor cancels";
    add("demodulation, ordinary weights", "weights over the root of their sum of squares", {});
    add("demodulation, weights all zero", epsilon, {.weight = 0.0});
    add("demodulation, style and its bias all zero", epsilon, {.style = 0.0, .bias = 0.0});
    add("demodulation, weights of 1e-20", epsilon, {.weight = 1e-20});
    add("demodulation, weights of 1e20", units, {.weight = 1e20});
    add("demodulation, style of length 1e3", units, {.style = 1e3});
    add("demodulation, style of length 1e6", units, {.style = 1e6});
    add("demodulation, style of length 1e20", units, {.style = 1e20});
    add("demodulation, weights of 1e20 and style of 1e-20", units,
        {.style = 1e-20, .weight = 1e20, .bias = 1e-20});
    add("demodulation, weights and style of 1e18", units, {.style = 1e18, .weight = 1e18});
    return rows;
}

std::function<StabilityResult(DType)> normalised(double variance) {
    return [=](DType dtype) {
        ParameterStore store;
        const BatchNorm norm(store, "norm", 3, {.initial_variance = variance});
        store.convert(dtype);
        return differentiate(
            dtype, {Rng(1).normal({4, 3}, 0.0, 1.0)},
            [&](const std::vector<Variable>& x) { return std::vector<Variable>{norm(x[0])}; });
    };
}

std::vector<StabilityCase> normalisation_cases() {
    std::vector<StabilityCase> rows;
    for (const auto& [name, variance] :
         {std::pair{"0", 0.0}, std::pair{"1e-30", 1e-30}, std::pair{"1e30", 1e30}})
        rows.push_back({.name = std::string("batch norm, stored variance ") + name,
                        .behaviour = "1e-5 under the root",
                        .value_bound = 1e-6,
                        .gradient_bound = 1e-6,
                        .run = normalised(variance)});
    rows.push_back(refused<NumericError>("batch norm, stored variance -1",
                                         "refused: the root of a negative number",
                                         "norm.running_variance", normalised(-1.0)));
    const auto deviation = [](std::int64_t group) {
        return [group](const std::vector<Variable>& x) {
            return std::vector<Variable>{append_minibatch_deviation(x[0], group)};
        };
    };
    const Tensor one = Rng(2).normal({1, 2, 2, 3}, 0.0, 1.0),
                 constant = Tensor::full({4, 2, 2, 3}, 0.7);
    rows.push_back(row("minibatch deviation of one image, two derivatives",
                       "variance 0: deviation 1e-4, gradient 0", 1e-6, 1e-6, {one}, deviation(1),
                       2));
    rows.push_back(row("minibatch deviation of equal images, two derivatives",
                       "1e-8 under the root bounds both derivatives", 1e-6, 1e-5, {constant},
                       deviation(4), 2));
    return rows;
}

std::vector<StabilityCase> direction_cases() {
    std::vector<StabilityCase> rows;
    for (const auto& [name, length] :
         {std::pair{"0", 0.0}, std::pair{"1e-30", 1e-30}, std::pair{"1e-20", 1e-20},
          std::pair{"1e20", 1e20}, std::pair{"1e30", 1e30}}) {
        const std::string behaviour =
            length == 0.0 ? "no direction: value 0, the norm counts as the constant 1"
                          : "norms whose square leaves float32's range are summed in float64";
        rows.push_back(row(std::string("unit channels, vectors of length ") + name, behaviour, 1e-5,
                           1e-5, {scaled(Rng(4).normal({1, 2, 2, 8}, 0.0, 1.0), length)},
                           each([](const Variable& x) { return unit_channels(x, 1e-10); })));
    }
    return rows;
}

}  // namespace

std::vector<StabilityCase> layer_cases() {
    return joined({demodulation_cases(), normalisation_cases(), direction_cases()});
}

}  // namespace stymo::stability
