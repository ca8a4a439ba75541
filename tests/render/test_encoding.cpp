#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/rng.h"
#include "render/encoding.h"
#include "support/check_grad.h"

using namespace stymo;

TEST_CASE("the encoding is the point, then blocks of three sines and cosines of doubling frequency",
          "[encoding]") {
    const std::vector<double> coordinates{0.3, -1.2, 2.0, 5.0, 0.0, -0.7};
    const Tensor encoded = positional_encoding(Tensor::from({1, 2, 3}, coordinates), 10).value();
    REQUIRE(encoded.shape() == Shape{1, 2, 63});
    REQUIRE(encoded_channels(10) == 63);
    const auto values = encoded.values<double>();
    for (std::size_t point = 0; point < 2; ++point) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double x = coordinates[3 * point + axis];
            CHECK(values[63 * point + axis] == x);
            for (std::size_t k = 0; k < 10; ++k) {
                const double phase = std::ldexp(x, static_cast<int>(k));
                CHECK(values[63 * point + 3 + 6 * k + axis] ==
                      Approx(std::sin(phase)).margin(1e-12));
                CHECK(values[63 * point + 6 + 6 * k + axis] ==
                      Approx(std::cos(phase)).margin(1e-12));
            }
        }
    }
}

TEST_CASE("float32 encodes the highest band of the sampled space to 1e-6", "[encoding]") {
    Rng rng(1);
    const Tensor points = rng.uniform({1000, 3}, -4.0, 4.0);
    const Tensor single = positional_encoding(points, 10).value();
    const Tensor exact = positional_encoding(points.to(DType::float64), 10).value();
    const auto actual = single.to_vector(), expected = exact.to_vector();
    double worst = 0.0;
    for (std::size_t i = 0; i < actual.size(); ++i) {
        worst = std::max(worst, std::abs(actual[i] - expected[i]));
    }
    CHECK(worst < 1e-6);
}

TEST_CASE("no frequencies leave the points as they are", "[encoding]") {
    const Tensor points = Tensor::full({2, 3}, 0.5);
    CHECK(positional_encoding(points, 0).value().to_vector() == points.to_vector());
}

TEST_CASE("the encoding's gradient agrees with finite differences", "[encoding]") {
    Rng rng(2);
    const auto report = test::check_grad(
        "positional_encoding",
        [](const std::vector<Variable>& inputs) { return positional_encoding(inputs[0], 4); },
        {rng.uniform({2, 3, 3}, -2.0, 2.0, DType::float64)});
    INFO(report.message);
    CHECK(report.passed);
}

TEST_CASE("what is not a point is refused", "[encoding]") {
    CHECK_THROWS_AS(positional_encoding(Tensor::zeros({4, 2}), 10), ShapeError);
    CHECK_THROWS_AS(positional_encoding(Tensor::zeros({4, 3}), -1), ValueError);
}
