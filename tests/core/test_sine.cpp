#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/ops/elementwise.h"
#include "core/ops/linalg.h"
#include "core/rng.h"

using namespace stymo;

TEST_CASE("Sine and cosine in float32 are accurate for arguments of any size", "[sine]") {
    for (const double reach : {3.0, 100.0, 8192.0, 1e7}) {
        const Tensor x = Rng(1).uniform({1003}, -reach, reach);
        const Tensor sines = sin(x).value(), cosines = cos(x).value();
        for (std::size_t i = 0; i < 1003; ++i) {
            const auto exact = static_cast<double>(x.values<float>()[i]);
            CHECK(std::abs(static_cast<double>(sines.values<float>()[i]) - std::sin(exact)) < 3e-7);
            CHECK(std::abs(static_cast<double>(cosines.values<float>()[i]) - std::cos(exact)) <
                  3e-7);
        }
    }
}

TEST_CASE("The sine of a number depends on that number alone", "[sine]") {
    Tensor x = Rng(2).uniform({64}, -10.0, 10.0);
    const Tensor expected = sin(x).value();
    x.mutable_values<float>()[5] = 1e6F;
    x.mutable_values<float>()[40] = std::numeric_limits<float>::quiet_NaN();
    const Tensor seen = sin(x).value();
    for (std::size_t i = 0; i < 64; ++i) {
        if (i != 5 && i != 40) CHECK(seen.values<float>()[i] == expected.values<float>()[i]);
    }
    CHECK(seen.values<float>()[5] == Approx(std::sin(1e6)).margin(1e-6));
    CHECK(std::isnan(seen.values<float>()[40]));
}

TEST_CASE("A linear layer with a sine has the bits of the sine of the layer without", "[sine]") {
    Rng rng(3);
    const Tensor x = rng.normal({1, 50, 40}, 0.0, 2.0), weight = rng.normal({1, 70, 40}, 0.0, 1.0),
                 bias = rng.normal({70}, 0.0, 1.0);
    const Tensor fused = linear(x, weight, bias, Activation::sine).value(),
                 composed = sin(linear(x, weight, bias)).value();
    CHECK(fused.to_vector() == composed.to_vector());
}
