#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "nn/losses.h"

using namespace stymo;

namespace {

Tensor tensor(const Shape& shape, const std::vector<double>& values) {
    return Tensor::from(shape, values);
}

}  // namespace

TEST_CASE("the photometric loss is the weighted sum of mean absolute differences") {
    const std::vector<Variable> images{tensor({1, 1, 1, 3}, {0.5, -1.0, 0.0}),
                                       tensor({1, 1, 2, 3}, {0, 0, 0, 1, 1, 1})};
    const std::vector<Tensor> targets{tensor({1, 1, 1, 3}, {-0.5, -1.0, 0.5}),
                                      tensor({1, 1, 2, 3}, {0, 0, 0, 0, 1, -1})};
    const std::vector<double> weights{0.1, 2.0};
    CHECK(photometric_loss(images, targets, weights).value().item() ==
          Approx(0.1 * 1.5 / 3.0 + 2.0 * 3.0 / 6.0));
    CHECK(photometric_loss(std::span(images).first(1), std::span(targets).first(1), weights)
              .value()
              .item() == Approx(0.05));
    CHECK_THROWS_AS(photometric_loss(images, targets, std::vector<double>{1.0}), ShapeError);
    CHECK_THROWS_AS(photometric_loss(images, {{targets[1], targets[0]}}, weights), ShapeError);
}

TEST_CASE(
    "the code loss sums squares over a code, averages over the batch and leaves out faces without "
    "codes") {
    const Variable zero = Tensor::zeros({3, 2}, DType::float64);
    const Codes z{{Variable::leaf(Tensor::full({3, 2}, 1.0, DType::float64)), zero, zero, zero}};
    const double missing = std::numeric_limits<double>::quiet_NaN();
    const Tensor target = tensor({3, 2}, {0.0, 3.0, missing, missing, 1.0, 2.0});
    const Tensor none = zero.value();
    const Tensor twos = Tensor::full({3, 2}, 2.0, DType::float64);
    const std::array<double, 4> weights{0.5, 1.0, 1.0, 0.25};
    const Variable loss =
        code_loss(z, {target, none, none, twos}, weights, tensor({3}, {1.0, 0.0, 1.0}));
    // Face 0: 1 + 4; face 2: 0 + 1; face 1 has no codes. Light: 4 for each number of two faces.
    CHECK(loss.value().item() == Approx(0.5 * (5.0 + 1.0) / 3.0 + 0.25 * 16.0 / 3.0));
    const std::vector<double> gradient = grad(loss, z.groups[0]).value().to_vector();
    CHECK(gradient[0] == Approx(0.5 * 2.0 / 3.0));
    CHECK(gradient[2] == 0.0);
    CHECK_THROWS_AS(code_loss(z, {target, none, none, none}, weights, tensor({2}, {1.0, 0.0})),
                    ShapeError);
}

TEST_CASE("the mask loss is the mean binary cross-entropy, finite for any logit") {
    const Variable logit = tensor({1, 1, 3, 1}, {0.0, 2.0, -1e4});
    const Tensor mask = tensor({1, 1, 3, 1}, {1.0, 0.0, 1.0});
    CHECK(mask_loss(logit, mask).value().item() ==
          Approx((std::log(2.0) + std::log1p(std::exp(2.0)) + 1e4) / 3.0));
    CHECK_THROWS_AS(mask_loss(logit, tensor({3}, {1.0, 0.0, 1.0})), ShapeError);
}

TEST_CASE("the opacity loss is the cross-entropy of opacity and mask, with a bounded gradient") {
    const Tensor transmittance = tensor({1, 4, 1}, {0.25, 0.25, 0.0, 1.0});
    const auto loss = [&](const std::vector<double>& mask) {
        return opacity_loss(transmittance, tensor({1, 2, 2, 1}, mask)).value().item();
    };
    CHECK(loss({1, 0, 1, 0}) ==
          Approx(-(std::log(0.751) + std::log(0.251) + 2.0 * std::log(1.001)) / 4.0));
    CHECK(loss({0, 0, 0, 1}) == Approx(-(2.0 * std::log(0.251) + 2.0 * std::log(0.001)) / 4.0));
    const Variable leaf = Variable::leaf(transmittance);
    const Variable dL_dt = grad(opacity_loss(leaf, tensor({1, 4, 1}, {0, 0, 0, 1})), leaf);
    CHECK(dL_dt.value().values<double>()[2] == Approx(-1000.0 / 4.0));
    CHECK(dL_dt.value().values<double>()[3] == Approx(1000.0 / 4.0));
    CHECK_THROWS_AS(opacity_loss(transmittance, tensor({1}, {1.0})), ShapeError);
}

TEST_CASE("unknown pixels add nothing to a loss, and the others weigh as much as without them",
          "[unknown]") {
    const Tensor known = tensor({1, 1, 3, 1}, {1.0, 0.0, 1.0});
    const Variable logit = Variable::leaf(tensor({1, 1, 3, 1}, {0.0, 2.0, -1.0}));
    const Tensor mask = tensor({1, 1, 3, 1}, {1.0, 0.0, 0.0});
    const Variable seen = mask_loss(logit, mask, known);
    CHECK(seen.value().item() == Approx((std::log(2.0) + std::log1p(std::exp(-1.0))) / 3.0));
    CHECK(grad(seen, logit).value().to_vector()[1] == 0.0);
    CHECK(grad(seen, logit).value().to_vector()[0] ==
          Approx(grad(mask_loss(logit, mask), logit).value().to_vector()[0]));
    const Variable clear = Variable::leaf(tensor({1, 3, 1}, {0.25, 0.0, 1.0}));
    const Variable opacity = opacity_loss(clear, mask, known);
    CHECK(opacity.value().item() == Approx(-(std::log(0.751) + std::log(1.001)) / 3.0));
    CHECK(grad(opacity, clear).value().to_vector()[1] == 0.0);
}

TEST_CASE("the depth loss is the mean absolute difference of the rays that are present") {
    const Variable depth = Variable::leaf(tensor({1, 4, 1}, {5.0, 5.5, 7.0, 4.0}));
    const Tensor target = tensor({2, 2, 1}, {5.5, 5.0, 0.0, 4.25});
    const Variable loss = depth_loss(depth, target, tensor({2, 2, 1}, {1, 1, 0, 1}));
    CHECK(loss.value().item() == Approx((0.5 + 0.5 + 0.25) / 3.0));
    const std::vector<double> gradient = grad(loss, depth).value().to_vector();
    const std::vector<double> expected{-1.0 / 3.0, 1.0 / 3.0, 0.0, -1.0 / 3.0};
    for (std::size_t i = 0; i < 4; ++i) CHECK(gradient[i] == Approx(expected[i]));
    CHECK(depth_loss(depth, target, Tensor::zeros({4}, DType::float64)).value().item() == 0.0);
    CHECK_THROWS_AS(depth_loss(depth, target, tensor({1}, {1.0})), ShapeError);
    CHECK_THROWS_AS(depth_loss(depth, tensor({1}, {1.0}), target), ShapeError);
}

TEST_CASE("the masked mean is that of the pixels under the mask, and 0 where there are none") {
    const Variable images =
        Variable::leaf(tensor({2, 1, 3, 2}, {1, 10, 2, 20, 3, 30, 4, 40, 5, 50, 6, 60}));
    const Variable mean_colour = masked_mean(images, tensor({2, 1, 3, 1}, {1, 0, 0.5, 0, 0, 0}));
    CHECK(mean_colour.shape() == Shape{2, 1, 1, 2});
    const auto colours = mean_colour.value().to_vector();
    CHECK(colours[0] == Approx((1.0 + 0.5 * 3.0) / 1.5));
    CHECK(colours[1] == Approx((10.0 + 0.5 * 30.0) / 1.5));
    CHECK(colours[2] == 0.0);
    CHECK(colours[3] == 0.0);
    const GradOptions ones{.create_graph = false,
                           .dL_dy = Tensor::full({2, 1, 1, 2}, 1.0, DType::float64)};
    const auto gradient = grad(mean_colour, images, ones).value().to_vector();
    CHECK(gradient[0] == Approx(1.0 / 1.5));
    CHECK(gradient[4] == Approx(0.5 / 1.5));
    for (std::size_t i = 6; i < 12; ++i) CHECK(gradient[i] == 0.0);
    CHECK_THROWS_AS(masked_mean(images, tensor({2, 1, 2, 1}, {1, 1, 1, 1})), ShapeError);
}

TEST_CASE("the opacity loss of a clear ray keeps its precision in float32") {
    const Variable clear = Variable::leaf(Tensor::full({1, 1, 1}, 1.0));
    const Variable loss = opacity_loss(clear, Tensor::full({1}, 1.0));
    CHECK(loss.value().item() == Approx(-std::log(1e-3)).epsilon(1e-6));
    CHECK(grad(loss, clear).value().item() == Approx(1e3).epsilon(1e-6));
}
