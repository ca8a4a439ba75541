#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "support/live_nodes.h"

using namespace stymo;
using namespace stymo::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;

namespace {

Variable leaf(double value) {
    return Variable::leaf(Tensor::scalar(value, DType::float64));
}

/// The sum of its inputs, with rules that count how often each of them runs.
Variable counted_sum(const Variable& a, const Variable& b, std::vector<int>& calls) {
    return record("counted_sum", add(a.detach(), b.detach()).value(), {a, b}, Save::none(),
                  {[&calls](const Vjp& v) { return ++calls[0], v.grad(); },
                   [&calls](const Vjp& v) { return ++calls[1], v.grad(); }});
}

}  // namespace

TEST_CASE("A chain of a million ops is differentiated and released", "[graph]") {
    constexpr int length = 1000000;
    const LiveNodes live;
    {
        const Variable x = leaf(2.0);
        Variable y = x;
        for (int i = 0; i < length; ++i) y = negate(y);
        CHECK(live.added() == length + 1);
        CHECK(grad(y, x).value().item() == 1.0);
    }
    CHECK(live.added() == 0);
}

TEST_CASE("A long chain of fused layers, whose rules hold their inputs, is released", "[graph]") {
    const LiveNodes live;
    {
        const Variable weight = Variable::leaf(Tensor::full({1, 1, 1}, 0.5, DType::float64));
        Variable y = Variable::leaf(Tensor::full({1, 1, 1}, 1.0, DType::float64));
        for (int i = 0; i < 200000; ++i) y = linear(y, weight, Variable(), Activation::sine);
        CHECK(y.value().all_finite());
    }
    CHECK(live.added() == 0);
}

TEST_CASE("A graph of gradients is released with its last value", "[graph]") {
    const LiveNodes live;
    {
        const Variable x = leaf(0.3);
        const Variable first = grad(sin(x) * exp(x), x, {.create_graph = true, .dL_dy = {}});
        const Variable second = grad(first, x, {.create_graph = true, .dL_dy = {}});
        CHECK(grad(second, x).value().all_finite());
        CHECK(live.added() > 1);
    }
    CHECK(live.added() == 0);
}

TEST_CASE("What is saved of an op is told for any number of inputs", "[graph]") {
    for (const std::size_t i : {0U, 31U, 32U, 100U}) {
        CHECK(Save::all_inputs().has_input(i));
        CHECK_FALSE(Save::none().has_input(i));
        CHECK(Save::input(31).has_input(i) == (i == 31));
    }
}

TEST_CASE("Constants are not recorded", "[graph]") {
    const LiveNodes live;
    const Variable constant(Tensor::scalar(2.0));
    CHECK_FALSE(exp(constant * constant).tracked());
    CHECK(live.added() == 0);
    const Variable x = leaf(1.0);
    CHECK_FALSE(exp(x.detach()).tracked());
    CHECK_FALSE(grad(exp(x), x).tracked());
    CHECK(grad(exp(x), x, {.create_graph = true, .dL_dy = {}}).tracked());
}

TEST_CASE("Only the rules on a path to what is asked run", "[graph]") {
    std::vector<int> calls(2, 0);
    const Variable a = leaf(1.0);
    const Variable b = leaf(2.0);
    const Variable y = counted_sum(a, b, calls);
    CHECK(grad(y, a).value().item() == 1.0);
    CHECK(calls == std::vector<int>{1, 0});
    static_cast<void>(grad(y, b));
    CHECK(calls == std::vector<int>{1, 1});
    static_cast<void>(grad(exp(a), b));
    CHECK(calls == std::vector<int>{1, 1});
}

TEST_CASE("A rule runs once however often its output is used", "[graph]") {
    std::vector<int> calls(2, 0);
    const Variable x = leaf(3.0);
    const Variable middle = counted_sum(x, x, calls);
    CHECK(grad(middle * middle + middle, x).value().item() == 2.0 * (2.0 * 6.0 + 1.0));
    CHECK(calls == std::vector<int>{1, 1});
}

TEST_CASE("Gradients of intermediate values, of repeated and of unrelated inputs", "[graph]") {
    const Variable x = leaf(2.0);
    const Variable unrelated = Variable::leaf(Tensor::zeros({2, 3}, DType::float64));
    const Variable middle = square(x);
    const std::vector<Variable> asked{middle, x, x, unrelated};
    const std::vector<Variable> gradients = grad(3.0 * middle, asked);
    CHECK(gradients[0].value().item() == 3.0);
    CHECK(gradients[1].value().item() == 12.0);
    CHECK(gradients[2].value().item() == 12.0);
    CHECK(gradients[3].value().to_vector() == std::vector<double>(6, 0.0));
    CHECK(gradients[3].shape() == Shape{2, 3});
    CHECK(gradients[3].dtype() == DType::float64);
}

TEST_CASE("Gradients in turn are those of grad, the last layer's first", "[graph]") {
    const Variable early = leaf(2.0), late = leaf(3.0), unrelated = leaf(5.0);
    const Variable y = square(early) * early * late;
    const std::vector<Variable> asked{unrelated, early, late};
    std::vector<std::size_t> order;
    std::vector<double> values;
    grad_in_turn(y, asked, [&](std::size_t i, const Variable& gradient) {
        order.push_back(i);
        values.push_back(gradient.value().item());
    });
    CHECK(order == std::vector<std::size_t>{2, 1, 0});
    CHECK(values == std::vector<double>{8.0, 36.0, 0.0});
    const std::vector<Variable> twice{early, early};
    CHECK_THROWS_AS(grad_in_turn(y, twice, [](std::size_t, const Variable&) {}), GradientError);
}

TEST_CASE("Partial gradients hold the other inputs fixed", "[graph]") {
    const Variable x = leaf(2.0);
    const Variable middle = square(x);
    const std::vector<Variable> asked{x, middle};
    const std::vector<Variable> whole = grad(middle * x, asked);
    CHECK(whole[0].value().item() == 12.0);
    CHECK(whole[1].value().item() == 2.0);
    const std::vector<Variable> partial = grad(middle * x, asked, {.partial = true, .dL_dy = {}});
    CHECK(partial[0].value().item() == 4.0);
    CHECK(partial[1].value().item() == 2.0);
}

TEST_CASE("What grad refuses", "[graph]") {
    const Variable x = leaf(1.0);
    const Variable vector = Variable::leaf(Tensor::zeros({3}, DType::float64));
    CHECK_THROWS_AS(grad(exp(vector), vector), GradientError);
    CHECK_THROWS_AS(grad(exp(x), x.detach()), GradientError);
    CHECK_THROWS_AS(grad(exp(vector), vector,
                         {.create_graph = false, .dL_dy = Tensor::zeros({2}, DType::float64)}),
                    ShapeError);
    CHECK(grad(exp(vector), vector,
               {.create_graph = false, .dL_dy = Tensor::full({3}, 2.0, DType::float64)})
              .value()
              .to_vector() == std::vector<double>(3, 2.0));
}

TEST_CASE("A missing rule names the op and the input", "[graph]") {
    const Variable x = leaf(1.0);
    const Variable y = record("ranking", x.value(), {x, x}, Save::none(),
                              {[](const Vjp& v) { return v.grad(); }, {}});
    CHECK_THROWS_AS(grad(y, x), GradientError);
    CHECK_THROWS_WITH(grad(y, x), Contains("[ranking]") && Contains("input 1"));
}

TEST_CASE("A rule may read only what its op saved", "[graph]") {
    const Variable x = leaf(1.0);
    const Variable y = leaf(2.0);
    const VjpRule reads_input = [](const Vjp& v) { return v.grad() * v.input(0); };
    const VjpRule reads_output = [](const Vjp& v) { return v.grad() * v.output(); };
    const auto with = [&](Save save, const VjpRule& rule) {
        return record("reader", x.value(), {x, y}, save, {rule, rule});
    };
    CHECK_THROWS_AS(grad(with(Save::none(), reads_input), x), GradientError);
    CHECK_THROWS_WITH(grad(with(Save::input(1), reads_input), x),
                      Contains("[reader]") && Contains("input 0"));
    CHECK_THROWS_AS(grad(with(Save::all_inputs(), reads_output), x), GradientError);
    CHECK(grad(with(Save::input(0), reads_input), x).value().item() == 1.0);
    CHECK(grad(with(Save::the_output(), reads_output), x).value().item() == 1.0);
}

TEST_CASE("A rule that returns another shape is refused", "[graph]") {
    const Variable x = Variable::leaf(Tensor::zeros({2, 3}, DType::float64));
    const Variable y = record("crooked", Tensor::scalar(1.0, DType::float64), {x}, Save::none(),
                              {[](const Vjp& v) { return v.grad(); }});
    CHECK_THROWS_AS(grad(y, x), ShapeError);
    CHECK_THROWS_WITH(grad(y, x), Contains("[crooked]") && Contains("(2, 3)"));
}
