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
#include "nn/layers/render_block.h"

using namespace stymo;
using namespace stymo::test;

namespace {

Tensor moved(const Tensor& x, const Tensor& direction, double step) {
    return (Variable(x) + Variable(direction) * step).value();
}

/// Central difference of fourth order, of `value` as a function of the step, which is so short that
/// hardly any leaky ReLU bends in it.
double derivative(const std::function<double(double)>& value) {
    constexpr double h = 1e-6;
    return (8.0 * (value(h) - value(-h)) - (value(2.0 * h) - value(-2.0 * h))) / (12.0 * h);
}

/// A layer or loss at fixed inputs and parameters.
struct Point {
    LayerFunction function;
    std::vector<Tensor> inputs;
    std::vector<Parameter> parameters{};

    Point(const LayerCase& layer_case, ParameterStore& store, Rng& rng)
        : function(layer_case.make(store, rng)) {
        store.convert(DType::float64);
        parameters = store.trainable();
        for (const Shape& shape : layer_case.inputs)
            inputs.push_back(rng.normal(shape, 0.0, 1.0, DType::float64));
    }

    [[nodiscard]] std::size_t size() const { return inputs.size() + parameters.size(); }
    [[nodiscard]] Tensor value(std::size_t i) const {
        return i < inputs.size() ? inputs[i] : parameters[i - inputs.size()].variable().value();
    }
    void set(std::size_t i, const Tensor& x) {
        if (i < inputs.size())
            inputs[i] = x;
        else
            parameters[i - inputs.size()].set_value(x);
    }
};

/// A number, and the inputs and parameters that it depends on.
struct Contraction {
    Variable number;
    std::vector<Variable> xs;
};

/// The value under random factors, or for order 2 its gradient under random factors.
Contraction contraction(const Point& point, int order, const Rng& draws) {
    Contraction result;
    for (const Tensor& input : point.inputs) result.xs.push_back(Variable::leaf(input));
    const Variable y = point.function(result.xs);
    for (const Parameter& parameter : point.parameters) result.xs.push_back(parameter.variable());
    const auto factors = [&](const Variable& of, std::uint64_t index) {
        return Variable(draws.split(index).normal(of.shape(), 0.0, 1.0, DType::float64));
    };
    result.number = sum(y * factors(y, 0));
    if (order == 1) return result;
    const std::vector<Variable> gradients =
        grad(result.number, result.xs, {.create_graph = true, .dL_dy = {}});
    result.number = Tensor::zeros({}, DType::float64);
    for (std::size_t i = 0; i < gradients.size(); ++i)
        result.number = result.number + sum(gradients[i] * factors(gradients[i], i + 1));
    return result;
}

}  // namespace

TEST_CASE(
    "every layer and loss has the declared shape and, of two orders, the gradients of finite "
    "differences") {
    for (const LayerCase& layer_case : layer_cases()) {
        Rng rng(11);
        ParameterStore store;
        Point point(layer_case, store, rng);
        REQUIRE(point.function({point.inputs.begin(), point.inputs.end()}).shape() ==
                layer_case.output);
        for (const int order : {1, 2}) {
            const Contraction at = contraction(point, order, Rng(12));
            const std::vector<Variable> gradients = grad(at.number, at.xs);
            for (std::size_t i = 0; i < point.size(); ++i) {
                INFO(layer_case.name << ", order " << order << ", input or parameter " << i);
                const Tensor x = point.value(i);
                const Tensor direction = rng.normal(x.shape(), 0.0, 1.0, DType::float64);
                const double numeric = derivative([&](double step) {
                    point.set(i, moved(x, direction, step));
                    return contraction(point, order, Rng(12)).number.value().item();
                });
                point.set(i, x);
                CHECK(sum(gradients[i] * Variable(direction)).value().item() ==
                      Approx(numeric).epsilon(1e-6).margin(order == 1 ? 1e-8 : 1e-7));
            }
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
