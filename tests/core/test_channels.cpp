#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "support/check_close.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE(
    "Directions of pixels and their gradients are those of the composition, also where all "
    "channels are 0",
    "[channels]") {
    Tensor values = Rng(2).normal({2, 3, 5, 48}, 0.0, 1.0);
    std::fill_n(values.mutable_values<float>().begin() + 2 * 48, 48, 0.0F);
    const Variable x = Variable::leaf(values);
    const Variable dL_dy = Rng(3).normal(values.shape(), 0.0, 1.0);
    const Variable fused = unit_channels(x, 1e-10);
    const Variable composed = unit_channels_reference(x, 1e-10);
    CHECK(check_close(fused.value(), composed.value(), 1e-6).passed);
    CHECK(check_close(grad(fused, x, {.create_graph = false, .dL_dy = dL_dy}).value(),
                      grad(composed, x, {.create_graph = false, .dL_dy = dL_dy}).value(), 1e-5)
              .passed);
}

TEST_CASE("The gradient of directions is right where squares leave float32", "[channels]") {
    for (const float size : {1e-20F, 1e20F}) {
        const Variable x = Variable::leaf(Tensor::from({1, 1, 1, 2}, std::vector{size, 0.0F}));
        const Variable dL_dy = Tensor::from({1, 1, 1, 2}, std::vector{1e-2F * size, 0.0F});
        const Variable wide = Variable::leaf(x.value().to(DType::float64));
        const auto along = [](const Variable& y, const Variable& at, const Tensor& seed) {
            return grad(y, at, {.create_graph = false, .dL_dy = seed}).value().to_vector()[0];
        };
        const double exact =
            along(unit_channels(wide, 1e-30), wide, dL_dy.value().to(DType::float64));
        CHECK(std::abs(along(unit_channels(x, 1e-30), x, dL_dy.value()) - exact) < 1e-8);
    }
}

TEST_CASE("The mean squared difference over many pixels is that of the composition", "[channels]") {
    const Variable a = Rng(2).normal({2, 70, 90, 16}, 0.0, 1.0);
    const Variable b = Rng(3).normal({2, 70, 90, 16}, 0.0, 1.0);
    CHECK(check_close(mean_squared_difference(a, b).value(), mean(square(a - b), {1, 2}).value(),
                      1e-6)
              .passed);
}
