#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>
#include <utility>

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
    template <class Render>
    [[nodiscard]] std::vector<Tensor> values_and_gradients(const Render& render) const {
        std::vector<Variable> xs{Variable::leaf(style)};
        for (const Parameter& parameter : store.trainable())
            if (parameter.name().find("feature1") == std::string::npos)
                xs.push_back(parameter.variable());
        const RenderedRays result = render(xs[0]);
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
    [[nodiscard]] std::vector<Tensor> values_and_gradients(
        bool fused, SineArguments arguments = SineArguments::recomputed) const {
        return values_and_gradients([&](const Variable& codes) {
            return fused ? field.render(rays, codes, arguments)
                         : field.render_reference(rays, codes);
        });
    }

    /// What the backward pass differentiates with a tolerance, as a composition: the optical depth
    /// of samples with a smaller weight is a constant that belongs to the sample behind them, or to
    /// the last one.
    [[nodiscard]] RenderedRays render_heavy(const Variable& codes, double tolerance) const {
        const Tensor weights = field.render_reference(rays, codes).weights.weights.value();
        const std::int64_t samples = weights.shape(2);
        const std::vector<double> weight = weights.to_vector();
        Tensor heavy = Tensor::zeros(weights.shape(), DType::float64), gaps = heavy, last = heavy;
        Tensor tails = Tensor::zeros({weights.shape(0), weights.shape(1), 1}, DType::float64);
        for (std::int64_t ray = 0; ray < tails.size(); ++ray) {
            double transmittance = 1.0, gap = 0.0;
            std::optional<std::size_t> latest;
            for (std::int64_t k = 0; k < samples; ++k) {
                const auto at = static_cast<std::size_t>(ray * samples + k);
                const double depth = -std::log1p(-weight[at] / transmittance);
                transmittance -= weight[at];
                if (weight[at] < tolerance) {
                    gap += depth;
                    continue;
                }
                heavy.mutable_values<double>()[at] = 1.0;
                gaps.mutable_values<double>()[at] = std::exchange(gap, 0.0);
                latest = at;
            }
            if (!latest) continue;
            last.mutable_values<double>()[*latest] = 1.0;
            tails.mutable_values<double>()[static_cast<std::size_t>(ray)] = gap;
        }
        const FieldSamples at = field(rays.points, codes);
        const Variable density =
            reshape(at.density, heavy.shape()) * Variable(heavy) + Variable(gaps) / rays.deltas;
        CompositeWeights result = composite_weights(density, rays.deltas);
        const Variable behind = result.transmittance * exp(-Variable(tails));
        result.weights = result.weights + Variable(last) * (result.transmittance - behind);
        result.transmittance = behind;
        return {result, composite(result.weights, at.features)};
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

TEST_CASE("samples of little weight are constants of the backward pass", "[field]") {
    for (const bool some_left_out : {false, true}) {
        Case given(DType::float64);
        if (some_left_out) given.leave_out();
        const std::vector<Tensor> exact = given.values_and_gradients(true);
        for (const double tolerance : {1e-9, 0.03, 0.1}) {
            CAPTURE(some_left_out, tolerance);
            given.rays.gradient_tolerance = tolerance;
            const std::vector<Tensor> found = given.values_and_gradients(true, SineArguments::kept);
            const std::vector<Tensor> expected = given.values_and_gradients(
                [&](const Variable& codes) { return given.render_heavy(codes, tolerance); });
            // The forward pass looks at all samples.
            for (std::size_t i = 0; i < 3; ++i) CHECK(identical(found[i], exact[i]));
            check_equal({found.begin() + 3, found.end()}, {expected.begin() + 3, expected.end()},
                        1e-6);
            given.rays.gradient_tolerance = 0.0;
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
