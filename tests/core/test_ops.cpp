#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/op_cases.h"
#include "core/ops/ops.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/live_nodes.h"
#include "support/thread_count.h"

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::uint64_t seed = 7;

std::vector<Array> to_arrays(const std::vector<Tensor>& tensors) {
    std::vector<Array> arrays;
    for (const Tensor& tensor : tensors) arrays.push_back(to_array(tensor));
    return arrays;
}

/// The value and the gradients of all inputs, for a cotangent that differs from element to element.
std::vector<Tensor> value_and_gradients(const OpCase& row, const std::vector<Tensor>& inputs,
                                        bool create_graph) {
    const std::vector<Variable> leaves = as_leaves(inputs);
    const Variable y = row.function(leaves);
    const Variable dL_dy = Rng(seed).uniform(y.shape(), -1.0, 1.0, y.dtype());
    std::vector<Tensor> results{y.value()};
    for (const Variable& gradient :
         grad(y, leaves, {.create_graph = create_graph, .dL_dy = dL_dy})) {
        results.push_back(gradient.value());
    }
    return results;
}

}  // namespace

TEST_CASE("Every op has the value of its definition", "[ops]") {
    for (const OpCase& row : op_cases()) {
        const std::vector<Tensor> inputs = draw_inputs(row, DType::float64, seed);
        const Tensor expected = to_tensor(row.reference(to_arrays(inputs)));
        const CloseReport report =
            check_close(row.function(as_constants(inputs)).value(), expected, 1e-12);
        INFO(row.name() << ": " << report.message);
        CHECK(report.passed);
        const CloseReport tracked =
            check_close(row.function(as_leaves(inputs)).value(), expected, 1e-12);
        INFO(row.name() << ", recorded: " << tracked.message);
        CHECK(tracked.passed);
    }
}

TEST_CASE("Every op in float32 agrees with float64", "[ops]") {
    for (const OpCase& row : op_cases()) {
        const std::vector<Tensor> inputs = draw_inputs(row, DType::float32, seed);
        std::vector<Tensor> wide;
        for (const Tensor& input : inputs) wide.push_back(input.to(DType::float64));
        const Tensor value = row.function(as_constants(inputs)).value();
        CHECK(value.dtype() == DType::float32);
        const CloseReport report =
            check_close(value, row.function(as_constants(wide)).value(), 1e-5);
        INFO(row.name() << ": " << report.message);
        CHECK(report.passed);
    }
}

TEST_CASE("Every op's gradients agree with finite differences at orders 1 and 2",
          "[ops][gradients]") {
    for (const OpCase& row : op_cases()) {
        const GradReport report =
            check_grad(row.name(), row.function, draw_inputs(row, DType::float64, seed));
        INFO(report.message);
        CHECK(report.passed);
    }
}

TEST_CASE("Every op's gradient is the same whether or not it is recorded", "[ops][gradients]") {
    for (const OpCase& row : op_cases()) {
        const std::vector<Tensor> inputs = draw_inputs(row, DType::float64, seed);
        const std::vector<Tensor> plain = value_and_gradients(row, inputs, false);
        const std::vector<Tensor> recorded = value_and_gradients(row, inputs, true);
        for (std::size_t i = 0; i < plain.size(); ++i) {
            const CloseReport report = check_close(recorded[i], plain[i], 1e-12);
            INFO(row.name() << ", " << (i == 0 ? "value" : "gradient") << ": " << report.message);
            CHECK(report.passed);
        }
    }
}

TEST_CASE("Every op gives the same bits on one and on two threads", "[ops][threads]") {
    const ThreadCount restored;
    for (const OpCase& row : op_cases()) {
        if (row.speed_shapes.empty()) continue;
        const std::vector<Tensor> inputs = draw_speed_inputs(row, DType::float32, seed);
        set_thread_count(1);
        const std::vector<Tensor> one = value_and_gradients(row, inputs, false);
        set_thread_count(2);
        const std::vector<Tensor> two = value_and_gradients(row, inputs, false);
        for (std::size_t i = 0; i < one.size(); ++i) {
            INFO(row.name() << (i == 0 ? ", value" : ", gradient of input ")
                            << (i == 0 ? "" : std::to_string(i - 1)));
            CHECK(identical(one[i], two[i]));
        }
    }
}

TEST_CASE("No op leaves a node behind", "[ops]") {
    const LiveNodes live;
    for (const OpCase& row : op_cases()) {
        static_cast<void>(value_and_gradients(row, draw_inputs(row, DType::float64, seed), true));
        INFO(row.name());
        CHECK(live.added() == 0);
    }
}

TEST_CASE("Activations do not overflow", "[ops]") {
    const std::vector<double> extremes{-1000.0, -100.0, 0.0, 100.0, 1000.0};
    const Variable x = Variable::leaf(Tensor::from({5}, std::span<const double>(extremes)));
    for (const Variable& narrow_or_wide : {x, Variable::leaf(x.value().to(DType::float32))}) {
        for (const Variable& y :
             {softplus(narrow_or_wide), sigmoid(narrow_or_wide), tanh(narrow_or_wide)}) {
            CHECK(y.value().all_finite());
            CHECK(grad(sum(y), narrow_or_wide).value().all_finite());
        }
    }
    CHECK(softplus(x).value().values<double>()[4] == 1000.0);
    CHECK(softplus(x).value().values<double>()[1] == Approx(std::exp(-100.0)));
    const double infinity = std::numeric_limits<double>::infinity();
    CHECK(relu(Variable(Tensor::scalar(-infinity, DType::float64))).value().item() == 0.0);
    CHECK(std::isnan(relu(Variable(Tensor::scalar(std::nan(""), DType::float64))).value().item()));
}

TEST_CASE("At a kink the gradient is the documented one", "[ops]") {
    const Variable zero = Variable::leaf(Tensor::scalar(0.0, DType::float64));
    const Variable other = Variable::leaf(Tensor::scalar(0.0, DType::float64));
    CHECK(grad(abs(zero), zero).value().item() == 0.0);
    CHECK(grad(leaky_relu(zero, 0.2), zero).value().item() == 0.2);
    CHECK_THROWS_AS(leaky_relu(zero, -0.1), ValueError);
    CHECK(grad(relu(zero), zero).value().item() == 0.0);
    CHECK(grad(clamp(zero, 0.0, 1.0), zero).value().item() == 1.0);
    CHECK(grad(maximum(zero, other), zero).value().item() == 1.0);
    CHECK(grad(maximum(zero, other), other).value().item() == 0.0);
    CHECK(grad(minimum(zero, other), zero).value().item() == 1.0);
    CHECK(grad(minimum(zero, other), other).value().item() == 0.0);
}

TEST_CASE("Maximum and minimum take a NaN from either operand, with its gradient", "[ops]") {
    const Variable nan = Variable::leaf(Tensor::scalar(std::nan(""), DType::float64));
    const Variable one = Variable::leaf(Tensor::scalar(1.0, DType::float64));
    for (const auto op : {maximum, minimum}) {
        for (const Variable& y : {op(nan, one), op(one, nan)}) {
            CHECK(std::isnan(y.value().item()));
            CHECK(grad(y, nan).value().item() == 1.0);
            CHECK(grad(y, one).value().item() == 0.0);
        }
    }
}

TEST_CASE("Gradients exist where an extent is 0, and have the type of the result", "[ops]") {
    for (const auto& [rows, in, out] : {std::array{5, 0, 4}, std::array{5, 3, 0}}) {
        const Variable x = Variable::leaf(Tensor::zeros({2, rows, in}));
        const Variable weight = Variable::leaf(Tensor::zeros({1, out, in}));
        const Variable y = linear(x, weight, {});
        const Variable dL_dy = Tensor::full(y.shape(), 1.0);
        CHECK(grad(y, x, {.create_graph = false, .dL_dy = dL_dy}).shape() == x.shape());
        CHECK(grad(y, weight, {.create_graph = false, .dL_dy = dL_dy}).shape() == weight.shape());
        CHECK_THROWS_AS(
            grad(y, x,
                 {.create_graph = false, .dL_dy = Tensor::full(y.shape(), 1.0, DType::float64)}),
            TypeError);
    }
    const Variable coarse = Variable::leaf(Tensor::zeros({1, 0, 4, 2}));
    const Variable y = pixel_shuffle_onto(coarse, Tensor::zeros({1, 0, 4, 8}));
    CHECK(grad(y, coarse, {.create_graph = false, .dL_dy = Tensor::zeros(y.shape())}).shape() ==
          coarse.shape());
}

TEST_CASE("An infinite gradient of what where does not take stays out", "[ops]") {
    const Variable a = Variable::leaf(Tensor::full({2}, 4.0, DType::float64));
    constexpr std::array<double, 2> taken{1.0, 0.0};
    const Tensor mask = Tensor::from({2}, std::span<const double>(taken));
    const Variable y = sum(sqrt(where(mask, a, Variable(Tensor::zeros({2}, DType::float64)))));
    CHECK(grad(y, std::vector{a})[0].value().to_vector() == std::vector<double>{0.25, 0.0});
}

TEST_CASE("Ops on empty tensors have the right shapes, and gradients of zero", "[ops]") {
    CHECK(transpose(Variable(Tensor::zeros({0, 5}))).shape() == Shape{5, 0});
    const auto gradients_of = [](const Variable& y, const std::vector<Variable>& leaves) {
        double largest = 0.0;
        for (const Variable& gradient : grad(sum(y), leaves))
            for (const double value : gradient.value().to_vector())
                largest = std::max(largest, std::abs(value));
        return largest;
    };
    const Variable x = Variable::leaf(Tensor::zeros({0, 8, 8, 16}));
    const Variable kernel = Variable::leaf(Tensor::full({16, 3, 3, 16}, 1.0));
    CHECK(gradients_of(conv2d(x, kernel, Conv2dOptions{.padding = 1}), {x, kernel}) == 0.0);
    for (const bool left : {true, false}) {
        const Variable none = Variable::leaf(Tensor::zeros({0, 3, 3}));
        const Variable one = Variable::leaf(Tensor::full({1, 3, 3}, 1.0));
        const Variable product = left ? matmul(none, one) : matmul(one, none);
        CHECK(product.shape() == Shape{0, 3, 3});
        CHECK(gradients_of(product, {none, one}) == 0.0);
    }
    const Variable no_batch = Variable::leaf(Tensor::zeros({0, 4, 16}));
    const Variable rows = Variable::leaf(Tensor::zeros({1, 0, 16}));
    const Variable weight = Variable::leaf(Tensor::full({1, 8, 16}, 1.0));
    const Variable bias = Variable::leaf(Tensor::full({8}, 1.0));
    for (const Activation activation : {Activation::none, Activation::sine, Activation::leaky_relu})
        for (const Variable& input : {rows, no_batch})
            CHECK(gradients_of(linear(input, weight, bias, activation), {input, weight, bias}) ==
                  0.0);
}

TEST_CASE("where does not show what it does not take", "[ops]") {
    const Tensor condition = Tensor::scalar(1.0, DType::float64);
    const Variable a = Variable::leaf(Tensor::scalar(2.0, DType::float64));
    const Variable b = Variable::leaf(Tensor::scalar(std::nan(""), DType::float64));
    CHECK(where(condition, a, b).value().item() == 2.0);
    CHECK(grad(where(condition, a, b), b).value().item() == 0.0);
}
