#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "render/composite.h"
#include "support/check_grad.h"

using namespace stymo;

namespace {

Tensor row(std::vector<double> values, DType dtype = DType::float64) {
    const auto count = static_cast<std::int64_t>(values.size());
    return Tensor::from({1, 1, count}, values).to(dtype);
}

double total(const std::vector<double>& values) {
    double result = 0.0;
    for (const double value : values) {
        result += value;
    }
    return result;
}

void check_gradient(const char* name, const test::GradFunction& function,
                    const std::vector<Tensor>& inputs) {
    const auto report = test::check_grad(name, function, inputs);
    INFO(report.message);
    CHECK(report.passed);
}

}  // namespace

TEST_CASE("a homogeneous slab lets exp(-sigma d) through", "[composite]") {
    for (const double density : {1e-9, 1e-3, 0.7, 12.0}) {
        // The steps do not matter: only their sum, 3, does.
        const auto result = composite_weights(Tensor::full({1, 1, 4}, density, DType::float64),
                                              row({0.5, 1.0, 0.25, 1.25}));
        CHECK(result.transmittance.value().item() ==
              Approx(std::exp(-3.0 * density)).epsilon(1e-14));
        CHECK(total(result.weights.value().to_vector()) ==
              Approx(-std::expm1(-3.0 * density)).epsilon(1e-14));
    }
}

TEST_CASE("weights are t_i alpha_i of equations (4) and (5)", "[composite]") {
    const std::vector<double> density{0.3, 2.0, 0.0, 5.0}, deltas{0.5, 0.25, 1.0, 0.1};
    const auto weights = composite_weights(row(density), row(deltas)).weights.value().to_vector();
    double transmittance = 1.0;
    for (std::size_t i = 0; i < 4; ++i) {
        const double alpha = 1.0 - std::exp(-density[i] * deltas[i]);
        CHECK(weights[i] == Approx(alpha * transmittance).margin(1e-15));
        transmittance *= 1.0 - alpha;
    }
}

TEST_CASE("thin fog keeps the relative precision of float32", "[composite]") {
    // 1 - exp(-x) in float32 would give 0 here.
    const auto result =
        composite_weights(Tensor::full({1, 1, 3}, 1e-7), Tensor::full({1, 1, 3}, 0.1));
    for (const double weight : result.weights.value().to_vector()) {
        CHECK(weight == Approx(1e-8).epsilon(1e-6));
    }
}

TEST_CASE("empty space has no weight and lets everything through", "[composite]") {
    const auto result = composite_weights(Tensor::zeros({2, 3, 4}), Tensor::full({2, 3, 4}, 0.2));
    CHECK(result.weights.value().to_vector() == std::vector<double>(24, 0.0));
    CHECK(result.transmittance.value().to_vector() == std::vector<double>(6, 1.0));
}

TEST_CASE("an opaque sample takes the whole weight", "[composite]") {
    const double infinity = std::numeric_limits<double>::infinity();
    for (const DType dtype : {DType::float32, DType::float64}) {
        for (const double density : {1e30, infinity}) {
            const auto all = composite_weights(row({density, density, density}, dtype),
                                               row({0.2, 0.2, 0.2}, dtype));
            CHECK(all.weights.value().to_vector() == std::vector<double>{1.0, 0.0, 0.0});
            CHECK(all.transmittance.value().item() == 0.0);
            const auto delta_density =
                composite_weights(row({0.0, density, 0.5}, dtype), row({0.2, 0.2, 0.2}, dtype));
            CHECK(delta_density.weights.value().to_vector() == std::vector<double>{0.0, 1.0, 0.0});
        }
    }
}

TEST_CASE("an infinite density in an interval of no length weighs nothing", "[composite]") {
    const auto result =
        composite_weights(row({std::numeric_limits<double>::infinity(), 0.0}), row({0.0, 1.0}));
    CHECK(result.weights.value().to_vector() == std::vector<double>{0.0, 0.0});
}

TEST_CASE("weights and transmittance sum to 1 in float32", "[composite]") {
    Rng rng(5);
    for (const double scale : {1e-3, 0.1, 1.0, 10.0, 1e4}) {
        const Tensor density = rng.uniform({2, 64, 64}, 0.0, scale);
        const auto result = composite_weights(density, rng.uniform({2, 64, 64}, 0.0, 0.2));
        const auto weights = result.weights.value().to_vector(),
                   transmittance = result.transmittance.value().to_vector();
        double worst = 0.0;
        for (std::size_t ray = 0; ray < transmittance.size(); ++ray) {
            const auto first = weights.begin() + static_cast<std::ptrdiff_t>(64 * ray);
            worst =
                std::max(worst, std::abs(total({first, first + 64}) + transmittance[ray] - 1.0));
        }
        CHECK(worst < 1e-6);
    }
}

TEST_CASE("compositing is the weighted sum of each ray's own features", "[composite]") {
    // Two cameras, two rays, two samples, one channel.
    const Tensor weights = Tensor::from({2, 2, 2}, std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8});
    const Tensor features =
        Tensor::from({2, 4, 1}, std::vector<double>{1, 10, 100, 1000, 2, 20, 200, 2000});
    const Tensor result = composite(weights, features).value();
    CHECK(result.shape() == Shape{2, 2, 1});
    CHECK(result.to_vector() == std::vector<double>{21, 4300, 130, 17400});
}

TEST_CASE("the expected depth of a surface is its distance, of nothing the background's",
          "[composite]") {
    const Tensor depths = row({2.0, 3.0, 4.0}), deltas = row({1.0, 1.0, 1.0});
    CHECK(composite_depth(composite_weights(row({0.0, 1e9, 0.0}), deltas), depths, 9.0)
              .value()
              .item() == Approx(3.0));
    CHECK(composite_depth(composite_weights(row({0.0, 0.0, 0.0}), deltas), depths, 9.0)
              .value()
              .item() == Approx(9.0));
    const double half = std::log(2.0);
    CHECK(composite_depth(composite_weights(row({half, 0.0, 1e9}), deltas), depths, 9.0)
              .value()
              .item() == Approx(3.0));
}

TEST_CASE("the depth variance is that of the normalised weights", "[composite]") {
    const Tensor depths = row({2.0, 3.0, 5.0});
    CHECK(depth_variance(row({0.0, 0.4, 0.0}), depths).value().item() == Approx(0.0).margin(1e-12));
    CHECK(depth_variance(row({0.25, 0.0, 0.25}), depths).value().item() == Approx(2.25));
    CHECK(depth_variance(row({0.0, 0.0, 0.0}), depths).value().item() == 0.0);
}

TEST_CASE("compositing's gradients agree with finite differences", "[composite]") {
    Rng rng(8);
    const Tensor density = rng.uniform({2, 3, 4}, 0.1, 4.0, DType::float64);
    const Tensor features = rng.normal({2, 12, 5}, 0.0, 1.0, DType::float64);
    const Tensor deltas = rng.uniform({2, 3, 4}, 0.1, 0.4, DType::float64);
    const Tensor depths = rng.uniform({2, 3, 4}, 3.0, 9.0, DType::float64);
    check_gradient("composite",
                   [&](const auto& inputs) {
                       return composite(composite_weights(inputs[0], deltas).weights, inputs[1]);
                   },
                   {density, features});
    check_gradient("composite_depth",
                   [&](const auto& inputs) {
                       return composite_depth(composite_weights(inputs[0], deltas), depths, 9.0);
                   },
                   {density});
    check_gradient("depth_variance",
                   [&](const auto& inputs) {
                       return depth_variance(composite_weights(inputs[0], deltas).weights, depths);
                   },
                   {density});
}

TEST_CASE("the gradient behind t_i alpha_i is delta_i t_(i+1) for a sample's own weight",
          "[composite]") {
    const Variable density = Variable::leaf(row({0.3, 2.0}, DType::float32));
    const auto result = composite_weights(density, row({0.5, 0.25}, DType::float32));
    const auto gradient = grad(sum(slice(result.weights, 2, 1, 2)), density).value().to_vector();
    // w_1 = exp(-s_0 d_0) (1 - exp(-s_1 d_1))
    CHECK(gradient[0] == Approx(-0.5 * std::exp(-0.15) * (1.0 - std::exp(-0.5))).epsilon(1e-6));
    CHECK(gradient[1] == Approx(0.25 * std::exp(-0.65)).epsilon(1e-6));
}

TEST_CASE("gradients stay finite for any density", "[composite]") {
    const double infinity = std::numeric_limits<double>::infinity();
    for (const double density : {0.0, 1e-38, 1e-20, 1e5, 1e20, 1e30, 1e38, infinity}) {
        const Variable leaf = Variable::leaf(Tensor::full({1, 2, 8}, density));
        const Tensor deltas = Tensor::full({1, 2, 8}, 0.2);
        const auto result = composite_weights(leaf, deltas);
        const Tensor depths = Tensor::full({1, 2, 8}, 5.0);
        const Variable loss =
            sum(composite_depth(result, depths, 9.0)) + depth_variance(result.weights, depths);
        INFO("density " << density);
        CHECK(result.weights.value().all_finite());
        CHECK(grad(loss, leaf).value().all_finite());
    }
}

TEST_CASE("shapes that do not belong together are refused", "[composite]") {
    const Tensor a = Tensor::zeros({1, 2, 3}), b = Tensor::zeros({1, 3, 2});
    CHECK_THROWS_AS(composite_weights(a, b), ShapeError);
    CHECK_THROWS_AS(composite(a, Tensor::zeros({1, 5, 4})), ShapeError);
    CHECK_THROWS_AS(composite_depth(composite_weights(a, a), b, 0.0), ShapeError);
    CHECK_THROWS_AS(depth_variance(a, b), ShapeError);
}

TEST_CASE("the gradient of an opaque sample's weight keeps its relative precision", "[composite]") {
    // w = 1 - exp(-sigma delta): dw / dsigma = delta exp(-sigma delta), down to where float32
    // itself ends.
    for (const double density : {20.0, 60.0, 200.0}) {
        const Variable leaf = Variable::leaf(row({density}, DType::float32));
        const auto result = composite_weights(leaf, row({0.25}, DType::float32));
        INFO("density " << density);
        CHECK(grad(sum(result.weights), leaf).value().item() ==
              Approx(0.25 * std::exp(-0.25 * density)).epsilon(1e-5));
    }
}

TEST_CASE("samples in reverse order are refused", "[composite]") {
    CHECK_THROWS_WITH(composite_weights(row({1.0, 1.0, 1.0}), row({0.5, -0.5, 0.5})),
                      Catch::Contains("[composite_weights] deltas: interval 1 of ray 0"));
    CHECK_THROWS_AS(composite_weights(row({1.0}), row({std::nan("")})), ValueError);
}

TEST_CASE("Samples that are not in order are refused with their index", "[composite]") {
    Tensor deltas = Tensor::full({2, 3, 4}, 0.0);
    CHECK_NOTHROW(require_ordered_samples("f", deltas));
    deltas.mutable_values<float>()[12 + 6] = -0.25F;
    CHECK_THROWS_WITH(require_ordered_samples("f", deltas),
                      Catch::Contains("[f] deltas: interval 2 of ray 1 has length -0.25"));
    deltas.mutable_values<float>()[12 + 6] = std::nanf("");
    CHECK_THROWS_AS(require_ordered_samples("f", deltas), ValueError);
}
