#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/modulated_linear.h"
#include "support/array.h"
#include "support/check_close.h"

using namespace stymo;
using namespace stymo::test;

namespace {

struct Case {
    ParameterStore store;
    ModulatedLinear layer;
    Tensor x, style;

    Case(Activation activation, DType dtype) : layer(make(store, activation)) {
        Rng rng(21);
        for (const Parameter& parameter : store.all())
            parameter.set_value(rng.normal(parameter.variable().shape(), 0.3, 1.0));
        store.convert(dtype);
        x = rng.normal({3, 7, 5}, 0.0, 1.0, dtype);
        style = rng.normal({3, 6}, 0.0, 1.0, dtype);
    }

    static ModulatedLinear make(ParameterStore& store, Activation activation) {
        Rng rng(20);
        return {store, "layer", 5, 4, 6, activation, rng};
    }

    [[nodiscard]] Array parameter(const std::string& name) const {
        for (const Parameter& each : store.all()) {
            if (each.name() == "layer." + name) return to_array(each.variable().value());
        }
        FAIL("no parameter " << name);
        return {};
    }
};

/// The definition: one weight for each sample, modulated, then divided by the length of each of its
/// rows.
Array by_loops(const Case& given, Activation activation) {
    const Array x = to_array(given.x), w = to_array(given.style);
    const Array weight = given.parameter("weight"), bias = given.parameter("bias");
    const Array style_weight = given.parameter("style.weight"),
                style_bias = given.parameter("style.bias");
    return generate({3, 7, 4}, [&](const Index& at) {
        const std::int64_t b = at[0], o = at[2];
        double squared_length = 0.0, product = 0.0;
        for (std::int64_t i = 0; i < 5; ++i) {
            double scale = style_bias.at({i});
            for (std::int64_t j = 0; j < 6; ++j)
                scale += style_weight.at({i, j}) * w.at({b, j}) / std::sqrt(6.0);
            const double modulated = weight.at({o, i}) * scale / std::sqrt(5.0);
            squared_length += modulated * modulated;
            product += modulated * x.at({b, at[1], i});
        }
        const double y = product / std::sqrt(squared_length + 1e-8);
        if (activation == Activation::sine) return std::sin(std::sqrt(2.0) * y + bias.at({o}));
        const double biased = y + bias.at({o});
        if (activation == Activation::none) return biased;
        return std::sqrt(2.0) * (biased > 0.0 ? biased : 0.2 * biased);
    });
}

}  // namespace

TEST_CASE("both paths of the modulated layer agree with its definition written as loops") {
    for (const Activation activation :
         {Activation::none, Activation::sine, Activation::leaky_relu}) {
        for (const DType dtype : {DType::float32, DType::float64}) {
            const Case given(activation, dtype);
            const Tensor expected = to_tensor(by_loops(given, activation)).to(dtype);
            const double tolerance = dtype == DType::float32 ? 1e-6 : 1e-12;
            const CloseReport fast =
                check_close(given.layer(given.x, given.style).value(), expected, tolerance);
            const CloseReport slow = check_close(
                given.layer.reference(given.x, given.style).value(), expected, tolerance);
            CHECK((fast.passed ? "" : fast.message) == std::string());
            CHECK((slow.passed ? "" : slow.message) == std::string());
        }
    }
}

TEST_CASE("both paths of the modulated layer have the same gradients") {
    for (const Activation activation :
         {Activation::none, Activation::sine, Activation::leaky_relu}) {
        const Case given(activation, DType::float64);
        const Variable x = Variable::leaf(given.x), style = Variable::leaf(given.style);
        std::vector<Variable> xs{x, style};
        for (const Parameter& parameter : given.store.all()) xs.push_back(parameter.variable());
        const std::vector<Variable> fast = grad(sum(square(given.layer(x, style))), xs);
        const std::vector<Variable> slow = grad(sum(square(given.layer.reference(x, style))), xs);
        for (std::size_t i = 0; i < xs.size(); ++i)
            CHECK(check_close(fast[i].value(), slow[i].value(), 1e-10).passed);
    }
}

TEST_CASE("demodulation cancels the scale of the weights and of the style") {
    const Case given(Activation::none, DType::float64);
    const Tensor before = given.layer(given.x, given.style).value();
    for (const Parameter& parameter : given.store.all()) {
        if (parameter.name() != "layer.bias")
            parameter.set_value((parameter.variable() * 5.0).value());
    }
    CHECK(check_close(given.layer(given.x, given.style).value(), before, 1e-6).passed);
}

TEST_CASE("what enters the sine keeps a deviation near one through eight layers") {
    Rng rng(4);
    ParameterStore store;
    const Tensor style = rng.normal({1, 6}, 0.0, 0.5);
    Variable x = rng.uniform({1, 512, 64}, -1.0, 1.0);
    double rms = 0.0;
    for (int i = 0; i < 8; ++i) {
        x = ModulatedLinear(store, "layer" + std::to_string(i), 64, 64, 6, Activation::sine, rng)(
            x, style);
        rms = std::sqrt(mean(square(x)).value().item());
    }
    // The sine of a normal number of deviation s has mean square (1 - exp(-2 s^2)) / 2; 0.64
    // belongs to s = 0.92.
    CHECK(rms == Approx(0.64).margin(0.04));
}

TEST_CASE("a modulated layer refuses inputs and styles that do not fit, naming itself") {
    const Case given(Activation::none, DType::float32);
    CHECK_THROWS_WITH(given.layer(Tensor({3, 7, 4}), given.style),
                      Catch::Contains("layer.weight") && Catch::Contains("(3, 7, 4)"));
    CHECK_THROWS_AS(given.layer(given.x, Tensor({2, 6})), ShapeError);
    CHECK_THROWS_AS(given.layer(given.x, Tensor({3, 5})), ShapeError);
}

TEST_CASE("a factor of the weights or of the styles cancels, however large") {
    for (const Activation activation : {Activation::none, Activation::sine}) {
        const Case ordinary(activation, DType::float32);
        const Tensor expected = ordinary.layer(ordinary.x, ordinary.style).value();
        for (const double factor : {0x1p60, 0x1p110}) {
            const Case scaled(activation, DType::float32);
            for (const Parameter& each : scaled.store.all())
                if (each.name() == "layer.weight")
                    each.set_value((Variable(each.variable().value()) * factor).value());
            const Variable style = Variable::leaf((Variable(scaled.style) * 1e3).value());
            CHECK(check_close(scaled.layer(scaled.x, scaled.style).value(), expected, 1e-5).passed);
            for (const Variable& gradient :
                 grad(sum(scaled.layer(scaled.x, style)), variables_of(scaled.store.all())))
                CHECK(gradient.value().all_finite());
        }
    }
}

TEST_CASE("a modulated layer without weights or styles gives its bias, and finite gradients") {
    const Case empty(Activation::none, DType::float32);
    for (const Parameter& each : empty.store.all())
        if (each.name() != "layer.bias") each.set_value(Tensor::zeros(each.variable().shape()));
    const Variable y = empty.layer(empty.x, empty.style);
    const Tensor bias = empty.store.all().back().variable().value();
    CHECK(check_close(y.value(), broadcast_to(Variable(bias), y.shape()).value(), 0.0).passed);
    for (const Variable& gradient : grad(sum(square(y)), variables_of(empty.store.all())))
        CHECK(gradient.value().all_finite());
}
