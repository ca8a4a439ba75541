#include <algorithm>
#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/live_nodes.h"

using namespace stymo;
using namespace stymo::test;
using Catch::Matchers::Contains;

namespace {

Tensor normal(const Shape& shape, std::uint64_t seed, DType dtype = DType::float64) {
    Rng rng(seed);
    return rng.normal(shape, 0.0, 1.0, dtype);
}

/// A few layers of one weight, which is a leaf, on x.
Segment layers_of(const Variable& weight, int count) {
    return [=](std::span<const Variable> inputs) {
        Variable x = inputs[0];
        for (int i = 0; i < count; ++i) x = linear(x, weight, {}, Activation::sine);
        return x;
    };
}

Variable run(bool recomputed, const Segment& segment, const std::vector<Variable>& inputs) {
    return recomputed ? recompute(segment, inputs) : segment(inputs);
}

}  // namespace

TEST_CASE("Recomputed layers have the bits of kept ones: values, gradients, gradients of gradients",
          "[recompute]") {
    for (const DType dtype : {DType::float32, DType::float64}) {
        const Variable first = Variable::leaf(normal({1, 5, 5}, 1, dtype));
        const Variable second = Variable::leaf(normal({1, 5, 5}, 2, dtype));
        const Variable x = Variable::leaf(normal({2, 7, 5}, 3, dtype));
        const std::vector<Variable> xs{x, first, second};
        std::vector<Tensor> kept;
        for (const bool recomputed : {false, true}) {
            const Variable middle = run(recomputed, layers_of(first, 1), {square(x)});
            const Variable y = mean(square(run(recomputed, layers_of(second, 1), {middle})));
            std::vector<Variable> found{y};
            const std::vector<Variable> gradients =
                grad(y, xs, {.create_graph = true, .dL_dy = {}});
            found.insert(found.end(), gradients.begin(), gradients.end());
            const Variable norm = sum(square(gradients[0]));
            for (const Variable& gradient : grad(norm, xs)) found.push_back(gradient);
            for (const Variable& gradient : grad(y, xs)) found.push_back(gradient);
            if (!recomputed) {
                for (const Variable& variable : found) kept.push_back(variable.value());
                continue;
            }
            for (std::size_t i = 0; i < found.size(); ++i) {
                CAPTURE(dtype, i);
                // Second derivatives meet at several nodes, so that the sums are grouped in
                // another way.
                const bool second_order = i > 3 && i <= 6;
                if (second_order)
                    CHECK(check_close(found[i].value(), kept[i],
                                      dtype == DType::float32 ? 1e-5 : 1e-13)
                              .passed);
                if (!second_order) CHECK(identical(found[i].value(), kept[i]));
            }
        }
    }
}

TEST_CASE("Gradients through recomputed parts agree with finite differences up to order 3",
          "[recompute]") {
    const auto function = [](const std::vector<Variable>& v) {
        const Segment inner = [](std::span<const Variable> inputs) {
            return sin(inputs[0]) * inputs[1];
        };
        const Segment outer = [inner](std::span<const Variable> inputs) {
            const Variable product = inputs[0] * exp(inputs[1]);
            return recompute(inner, {product, inputs[1]}) + product;
        };
        // The second input is computed from the first, and both from v[1], which therefore arrives
        // on several ways.
        const Variable half = v[0] * v[1];
        return recompute(outer, {half, sin(half) + v[1]}) * v[1];
    };
    const GradReport report = check_grad("recompute", function, {normal({2, 3}, 1), normal({3}, 2)},
                                         {.order = 3, .tolerance = 1e-5});
    INFO(report.message);
    CHECK(report.passed);
}

TEST_CASE("A leaf that is read both inside and before the segment gets each contribution once",
          "[recompute]") {
    const auto function = [](const std::vector<Variable>& v) {
        const Variable weight = v[0];
        const Segment segment = [weight](std::span<const Variable> inputs) {
            return sin(inputs[0]) * weight + inputs[1];
        };
        return recompute(segment, {square(weight), weight}) * weight;
    };
    const GradReport report =
        check_grad("recompute", function, {normal({4}, 3)}, {.order = 3, .tolerance = 1e-5});
    INFO(report.message);
    CHECK(report.passed);
}

TEST_CASE("Nothing of a segment is kept, and one segment at a time lives in the backward pass",
          "[recompute]") {
    constexpr int segments = 10, layers = 50;
    const Variable weight = Variable::leaf(normal({1, 2, 2}, 1));
    const Variable x = Variable::leaf(normal({1, 3, 2}, 2));
    const auto peak_of = [&](bool recomputed) {
        const LiveNodes live;
        std::int64_t peak = 0;
        const auto probe = [&](const Variable& v) {
            return record("probe", v.value(), {v}, Save::none(), {[&](const Vjp& vjp) {
                              peak = std::max(peak, live.added());
                              return vjp.grad();
                          }});
        };
        {
            const Segment segment = [&](std::span<const Variable> inputs) {
                return probe(layers_of(weight, layers)(inputs));
            };
            Variable y = x;
            for (int i = 0; i < segments; ++i) y = run(recomputed, segment, {y});
            if (recomputed) CHECK(live.added() == segments);
            CHECK(grad(sum(y), weight).value().all_finite());
        }
        CHECK(live.added() == 0);
        return peak;
    };
    const std::int64_t kept = peak_of(false);
    CHECK(kept > 2 * segments * layers);
    CHECK(peak_of(true) < kept / 8);
}

TEST_CASE("A segment runs once more for each backward pass, whatever is asked of it",
          "[recompute]") {
    int runs = 0;
    std::vector<int> rules(2, 0);
    const Variable a = Variable::leaf(normal({3}, 1));
    const Variable b = Variable::leaf(normal({3}, 2));
    const Segment segment = [&](std::span<const Variable> inputs) {
        ++runs;
        const auto count = [&rules](const Variable& x, std::size_t i) {
            return record("count", x.value(), {x}, Save::none(),
                          {[&rules, i](const Vjp& v) { return ++rules[i], v.grad(); }});
        };
        return count(inputs[0], 0) * count(b, 1);
    };
    const Variable y = sum(recompute(segment, {square(a)}));
    CHECK(runs == 1);
    static_cast<void>(grad(y, std::vector<Variable>{a, b}));
    CHECK(runs == 2);
    CHECK(rules == std::vector<int>{1, 1});
    static_cast<void>(grad(y, b));
    CHECK(runs == 3);
    CHECK(rules == std::vector<int>{1, 2});
    static_cast<void>(grad(y, a));
    CHECK(rules == std::vector<int>{2, 2});
    static_cast<void>(grad(y + sum(a), y));
    CHECK(runs == 4);
}

TEST_CASE("A gradient taken at once is the gradient, and nothing of the function's graph is kept",
          "[recompute]") {
    const auto function = [](const Variable& x) { return sum(square(sin(x)) * exp(x)); };
    const Variable x = Variable::leaf(normal({3, 4}, 1, DType::float32));
    const Variable kept = grad(function(square(x)) * 3.0, x);
    const LiveNodes live;
    {
        const Variable y = differentiate_at_once(function, square(x));
        CHECK(live.added() == 2);
        CHECK(identical(y.value(), function(square(x)).value()));
        CHECK(check_close(grad(y * 3.0, x).value(), kept.value(), 1e-6).passed);
    }
    CHECK(live.added() == 0);
    CHECK_FALSE(differentiate_at_once(function, x.detach()).tracked());
    CHECK_THROWS_AS(differentiate_at_once([](const Variable& v) { return exp(v); }, x),
                    GradientError);
    CHECK_THROWS_AS(
        grad(differentiate_at_once(function, x), x, {.create_graph = true, .dL_dy = {}}),
        GradientError);
}

TEST_CASE("A segment without anything tracked is computed once and recorded nowhere",
          "[recompute]") {
    const LiveNodes live;
    const Variable y = recompute([](std::span<const Variable> inputs) { return exp(inputs[0]); },
                                 {normal({3}, 1)});
    CHECK_FALSE(y.tracked());
    CHECK(live.added() == 0);
}

TEST_CASE("A segment may ignore an input, or return it", "[recompute]") {
    const Variable a = Variable::leaf(normal({3}, 1));
    const Variable b = Variable::leaf(normal({3}, 2));
    const Variable y =
        recompute([](std::span<const Variable> inputs) { return inputs[1]; }, {a, b});
    CHECK(identical(y.value(), b.value()));
    const std::vector<Variable> gradients = grad(sum(y), std::vector<Variable>{a, b});
    CHECK(gradients[0].value().to_vector() == std::vector<double>(3, 0.0));
    CHECK(gradients[1].value().to_vector() == std::vector<double>(3, 1.0));
}

TEST_CASE("What a segment may not do is refused", "[recompute]") {
    const Variable x = Variable::leaf(normal({3}, 1));
    const Variable outside = exp(x);
    SECTION("read a computed variable from outside") {
        const auto call = [&] {
            return recompute([&](std::span<const Variable> inputs) { return inputs[0] * outside; },
                             {square(x)});
        };
        CHECK_THROWS_AS(call(), GradientError);
        CHECK_THROWS_WITH(call(), Contains("[exp]") && Contains("pass it as an input"));
    }
    SECTION("let a variable out") {
        Variable escaped;
        const auto call = [&] {
            return recompute(
                [&](std::span<const Variable> inputs) {
                    escaped = sin(inputs[0]);
                    return escaped * escaped;
                },
                {outside});
        };
        CHECK_THROWS_WITH(call(), Contains("[sin]"));
    }
    SECTION("read the outer segment's input in an inner segment") {
        const Segment outer = [](std::span<const Variable> inputs) {
            const Variable of_outer = inputs[0];
            return recompute(
                [of_outer](std::span<const Variable> inner) { return inner[0] * of_outer; },
                {exp(of_outer)});
        };
        CHECK_THROWS_AS(recompute(outer, {x}), GradientError);
    }
    SECTION("read another leaf in the backward pass") {
        Variable weight = Variable::leaf(normal({3}, 2));
        const Variable old = weight;
        const Variable y = recompute(
            [&](std::span<const Variable> inputs) { return inputs[0] * weight; }, {outside});
        weight = Variable::leaf(normal({3}, 2));
        CHECK_THROWS_AS(grad(sum(y), old), GradientError);
    }
}
