#include <algorithm>
#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "nn/models/radiance_field.h"
#include "support/check_close.h"
#include "support/thread_count.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// A field with random biases, and rays that make several tiles.
struct Case {
    ParameterStore store;
    RadianceField field;
    RayPoints rays;
    Tensor style;

    explicit Case(DType dtype, std::int64_t layers = 5, std::int64_t samples = 9)
        : field(make(store, layers)), rays(), style() {
        Rng rng(5);
        for (const Parameter& parameter : store.all())
            if (parameter.name().ends_with(".bias") && !parameter.name().ends_with("style.bias"))
                parameter.set_value(rng.normal(parameter.variable().shape(), 0.0, 0.5));
        store.convert(dtype);
        rays = {rng.uniform({2, 40 * samples, 3}, -1.0, 1.0, dtype),
                rng.uniform({2, 40, samples}, 0.05, 0.4, dtype)};
        style = rng.normal({2, 7}, 0.0, 0.5, dtype);
    }

    static RadianceField make(ParameterStore& store, std::int64_t layers) {
        Rng rng(4);
        return {{.frequencies = 4,
                 .width = 20,
                 .layers = layers,
                 .feature_channels = 6,
                 .style_size = 7},
                store,
                "field",
                rng};
    }

    /// Samples that count for little are left out, and of some rays all.
    void leave_out() {
        Tensor kept = Rng(6).uniform(rays.deltas.shape(), 0.0, 1.0, DType::float64);
        std::int64_t i = 0;
        for (double& value : kept.mutable_values<double>())
            value = value < 0.6 || i++ % 200 < 30 ? 0.0 : 1.0;
        rays.significant = kept.to(rays.deltas.dtype());
    }

    /// Values, then gradients of a loss that takes in all of the result with different factors.
    [[nodiscard]] std::vector<Tensor> values_and_gradients(
        bool fused, SineArguments arguments = SineArguments::recomputed) const {
        std::vector<Variable> xs{Variable::leaf(style)};
        for (const Parameter& parameter : store.trainable())
            if (parameter.name().find("feature1") == std::string::npos)
                xs.push_back(parameter.variable());
        const RenderedRays result =
            fused ? field.render(rays, xs[0], arguments) : field.render_reference(rays, xs[0]);
        std::vector<Tensor> all{result.weights.weights.value(),
                                result.weights.transmittance.value(), result.composited.value()};
        Rng rng(9);
        Variable loss = Tensor::scalar(0.0, style.dtype());
        for (const Variable& part :
             {result.weights.weights, result.weights.transmittance, result.composited})
            loss = loss + sum(part * Variable(rng.normal(part.shape(), 0.0, 1.0, part.dtype())));
        for (const Variable& gradient : grad(loss, xs)) all.push_back(gradient.value());
        return all;
    }
};

void check_equal(const std::vector<Tensor>& actual, const std::vector<Tensor>& expected,
                 double tolerance) {
    REQUIRE(actual.size() == expected.size());
    for (std::size_t i = 0; i < actual.size(); ++i) {
        const CloseReport report = check_close(actual[i], expected[i], tolerance);
        INFO("result " << i << ": " << report.message);
        CHECK(report.passed);
    }
}

}  // namespace

TEST_CASE("the fused field has the values and gradients of its composition", "[field]") {
    for (const std::int64_t layers : {1, 3, 5}) {
        for (const std::int64_t samples : {2, 9, 200}) {
            if (samples == 200 && layers != 5) continue;
            CAPTURE(layers, samples);
            Case given(DType::float64, layers, samples);
            check_equal(given.values_and_gradients(true), given.values_and_gradients(false), 1e-10);
            given.leave_out();
            check_equal(given.values_and_gradients(true), given.values_and_gradients(false), 1e-10);
            check_equal(given.values_and_gradients(true, SineArguments::kept),
                        given.values_and_gradients(false), 1e-10);
        }
    }
}

TEST_CASE("the fused field in float32 is as near float64 as its composition", "[field]") {
    const Case narrow(DType::float32);
    check_equal(narrow.values_and_gradients(true), narrow.values_and_gradients(false), 2e-5);
}

TEST_CASE(
    "where the weights are frozen, the style's gradient is the same without a product for them",
    "[field]") {
    Case given(DType::float64);
    const Tensor with_weights = given.values_and_gradients(true)[3];
    given.store.set_trainable("", false);
    const std::vector<Tensor> frozen = given.values_and_gradients(true);
    CHECK(frozen.size() == 4);
    CHECK(check_close(frozen[3], with_weights, 1e-12).passed);
    CHECK(check_close(frozen[3], given.values_and_gradients(false)[3], 1e-10).passed);
}

TEST_CASE("a style that switches a channel off still has a gradient there", "[field]") {
    Case given(DType::float64);
    for (const Parameter& parameter : given.store.all()) {
        if (parameter.name() != "field.layer2.style.weight" &&
            parameter.name() != "field.layer2.style.bias")
            continue;
        Tensor value = parameter.variable().value();
        const std::int64_t columns = value.rank() == 2 ? value.shape(1) : 1;
        std::ranges::fill(
            value.mutable_values<double>().subspan(static_cast<std::size_t>(3 * columns),
                                                   static_cast<std::size_t>(columns)),
            0.0);
        parameter.set_value(value);
    }
    check_equal(given.values_and_gradients(true), given.values_and_gradients(false), 1e-10);
}

TEST_CASE("the fused field gives the same bits on any number of threads", "[field]") {
    const ThreadCount restored;
    const Case given(DType::float32);
    set_thread_count(1);
    const std::vector<Tensor> one = given.values_and_gradients(true);
    set_thread_count(3);
    const std::vector<Tensor> three = given.values_and_gradients(true);
    for (std::size_t i = 0; i < one.size(); ++i) CHECK(identical(one[i], three[i]));
}

TEST_CASE("what is kept for the backward pass changes no bit of the forward pass", "[field]") {
    for (const std::int64_t samples : {2, 9, 200}) {
        Case given(DType::float32, 5, samples);
        given.leave_out();
        const std::vector<Tensor> recomputed = given.values_and_gradients(true),
                                  kept = given.values_and_gradients(true, SineArguments::kept);
        for (std::size_t i = 0; i < 3; ++i) CHECK(identical(recomputed[i], kept[i]));
    }
}

TEST_CASE("samples that are left out count as empty space, and a ray without samples as clear",
          "[field]") {
    Case given(DType::float64);
    given.leave_out();
    const RenderedRays result = given.field.render(given.rays, given.style);
    CHECK(sum(result.weights.weights * (Variable(given.rays.significant) * -1.0 + 1.0))
              .value()
              .item() == 0.0);
    const std::vector<double> kept = sum(Variable(given.rays.significant), {2}).value().to_vector();
    const std::vector<double> transmittance = result.weights.transmittance.value().to_vector();
    std::int64_t clear = 0;
    for (std::size_t ray = 0; ray < kept.size(); ++ray) {
        if (kept[ray] > 0.0) continue;
        CHECK(transmittance[ray] == 1.0);
        ++clear;
    }
    CHECK(clear > 0);
    given.rays.significant = Tensor::full({2, 40, 8}, 1.0, DType::float64);
    CHECK_THROWS_AS(given.field.render(given.rays, given.style), ShapeError);
}
