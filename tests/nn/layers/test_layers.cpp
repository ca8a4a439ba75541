#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <regex>
#include <set>

#include "core/autograd/grad.h"
#include "core/io/file.h"
#include "core/ops/ops.h"
#include "nn/layer_cases.h"
#include "nn/layers/linear.h"
#include "nn/layers/upsampler.h"

using namespace stymo;
using namespace stymo::test;

namespace {

double dot(const Tensor& a, const Tensor& b) {
    double total = 0.0;
    for (std::size_t i = 0; i < a.values<double>().size(); ++i)
        total += a.values<double>()[i] * b.values<double>()[i];
    return total;
}

Tensor moved(const Tensor& x, const Tensor& direction, double step) {
    return (Variable(x) + Variable(direction) * step).value();
}

/// Central difference of fourth order, of `value` as a function of the step, which is so short that
/// hardly any leaky ReLU bends in it.
double derivative(const std::function<double(double)>& value) {
    constexpr double h = 1e-6;
    return (8.0 * (value(h) - value(-h)) - (value(2.0 * h) - value(-2.0 * h))) / (12.0 * h);
}

}  // namespace

TEST_CASE("every layer and loss has the declared shape and the gradients of finite differences") {
    for (const LayerCase& layer_case : layer_cases()) {
        INFO(layer_case.name);
        Rng rng(11);
        ParameterStore store;
        const LayerFunction function = layer_case.make(store, rng);
        store.convert(DType::float64);
        std::vector<Tensor> inputs;
        for (const Shape& shape : layer_case.inputs)
            inputs.push_back(rng.normal(shape, 0.0, 1.0, DType::float64));

        std::vector<Variable> leaves;
        for (const Tensor& input : inputs) leaves.push_back(Variable::leaf(input));
        const Variable y = function(leaves);
        REQUIRE(y.shape() == layer_case.output);
        const Tensor dL_dy = rng.normal(y.shape(), 0.0, 1.0, DType::float64);
        std::vector<Variable> xs = leaves;
        const std::vector<Parameter> parameters = store.trainable();
        for (const Parameter& parameter : parameters) xs.push_back(parameter.variable());
        const std::vector<Variable> gradients = grad(y, xs, {.dL_dy = dL_dy});

        const auto loss = [&](const std::vector<Tensor>& at) {
            return dot(function({at.begin(), at.end()}).value(), dL_dy);
        };
        for (std::size_t i = 0; i < xs.size(); ++i) {
            INFO("input or parameter " << i);
            const Tensor x = xs[i].value();
            const Tensor direction = rng.normal(x.shape(), 0.0, 1.0, DType::float64);
            const double numeric = derivative([&](double step) {
                if (i < inputs.size()) {
                    std::vector<Tensor> at = inputs;
                    at[i] = moved(x, direction, step);
                    return loss(at);
                }
                const Parameter& parameter = parameters[i - inputs.size()];
                parameter.set_value(moved(x, direction, step));
                const double value = loss(inputs);
                parameter.set_value(x);
                return value;
            });
            CHECK(dot(gradients[i].value(), direction) ==
                  Approx(numeric).epsilon(1e-6).margin(1e-8));
        }
    }
}

TEST_CASE("every header of nn/layers and every loss has a row in the table of cases") {
    std::set<std::string> covered;
    for (const LayerCase& layer_case : layer_cases()) covered.insert(layer_case.covers);
    const std::filesystem::path source = STYMO_SOURCE_DIR;
    int headers = 0;
    for (const auto& entry : std::filesystem::directory_iterator(source / "nn/layers")) {
        if (entry.path().extension() != ".h") continue;
        ++headers;
        INFO(entry.path().filename() << " has no row in tests/nn/layer_cases.cpp");
        CHECK(covered.contains(entry.path().stem().string()));
    }
    CHECK(headers >= 8);

    const std::string losses = read_file(source / "nn/losses.h");
    const std::regex declaration(R"(Variable (\w+)\()");
    int functions = 0;
    for (std::sregex_iterator match(losses.begin(), losses.end(), declaration);
         match != std::sregex_iterator(); ++match, ++functions) {
        INFO((*match)[1] << " has no row in tests/nn/layer_cases.cpp");
        CHECK(covered.contains((*match)[1]));
    }
    CHECK(functions >= 5);
}

TEST_CASE("a linear layer holds unit weights and scales them when used") {
    Rng rng(5);
    ParameterStore store;
    const Linear layer(store, "a", 400, 300,
                       {.learning_rate_multiplier = 0.01, .initial_bias = 2.0}, rng);
    const Tensor& stored = store.all()[0].variable().value();
    CHECK(std::sqrt(mean(square(Variable(stored))).value().item()) == Approx(100.0).epsilon(0.02));
    CHECK(std::sqrt(mean(square(layer.effective_weight())).value().item()) ==
          Approx(1.0 / 20.0).epsilon(0.02));
    CHECK(layer.effective_bias().value().values<float>()[7] == Approx(2.0));
}

TEST_CASE("weights depend on the seed and their name, not on what was created before them") {
    Rng rng(5);
    ParameterStore alone, after;
    const Linear first(alone, "b", 4, 3, {}, rng);
    const Linear other(after, "a", 9, 9, {}, rng);
    const Linear second(after, "b", 4, 3, {}, rng);
    CHECK(first.effective_weight().value().to_vector() ==
          second.effective_weight().value().to_vector());
    CHECK(first.effective_weight().value().to_vector() !=
          Linear(alone, "c", 4, 3, {}, rng).effective_weight().value().to_vector());
}

TEST_CASE("an upsampler with zero weights is a blurred nearest-neighbour upsampling") {
    Rng rng(5);
    ParameterStore store;
    const Upsampler upsampler(store, "up", 2, rng);
    for (const Parameter& parameter : store.all())
        parameter.set_value(Tensor::zeros(parameter.variable().shape()));
    const Tensor x = rng.normal({1, 3, 4, 2}, 0.0, 1.0);
    const Tensor y = upsampler(x).value();
    Tensor nearest({1, 6, 8, 2});
    for (std::size_t i = 0; i < 96; ++i) {
        const std::size_t channel = i % 2, column = i / 2 % 8, row = i / 16;
        nearest.mutable_values<float>()[i] =
            x.values<float>()[(row / 2 * 4 + column / 2) * 2 + channel];
    }
    const auto expected = blur(nearest).value().to_vector();
    for (std::size_t i = 0; i < 96; ++i)
        CHECK(y.values<float>()[i] == Approx(expected[i]).margin(1e-6));
}
