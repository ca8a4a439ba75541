#include <catch2/catch.hpp>
#include <cmath>

#include "render/soft_edge.h"

using namespace stymo;

TEST_CASE("a hard edge of the mask becomes as soft as its smoothed step, and stays in place",
          "[soft_edge]") {
    constexpr int side = 256, edge = 100;
    Tensor mask({side, side, 1});
    const auto values = mask.mutable_values<float>();
    for (int i = 0; i < side * side; ++i)
        values[static_cast<std::size_t>(i)] = i % side >= edge ? 1.0F : 0.0F;
    const Tensor image = Tensor::full({side, side, 3}, 0.8);
    const Tensor soft = with_soft_edge(image, mask);
    const auto shown = soft.values<float>();
    for (int x = 0; x < side; ++x) {
        INFO(x);
        // A step that a Gaussian of one pixel's deviation has smoothed, mapped from [0.5, 1].
        const double from_edge = x + 0.5 - edge;
        const double t = std::max(std::erf(from_edge / std::sqrt(2.0)), 0.0);
        const double wanted = 0.8 * t * t * (3.0 - 2.0 * t);
        CHECK(shown[static_cast<std::size_t>(3 * (128 * side + x))] == Approx(wanted).margin(0.03));
    }
}

TEST_CASE("an image without a head, or of a model without masks, stays as it is", "[soft_edge]") {
    const Tensor image = Tensor::full({16, 16, 3}, 0.8);
    for (const double mask : {0.0, 0.5, 0.89, 1.0})
        CHECK(with_soft_edge(image, Tensor::full({16, 16, 1}, mask)).to_vector() ==
              image.to_vector());
}
