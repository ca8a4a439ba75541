#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"

using namespace stymo;

namespace {

/// Derivative of the given order, of a function of one number.
double derivative(const std::function<Variable(const Variable&)>& function, double at, int order,
                  DType dtype) {
    const Variable x = Variable::leaf(Tensor::scalar(at, dtype));
    Variable y = function(x);
    for (int k = 0; k < order; ++k) y = grad(y, x, {.create_graph = true, .dL_dy = {}});
    return y.value().item();
}

}  // namespace

TEST_CASE("Derivatives of saturated activations keep their relative precision", "[precision]") {
    const auto hyperbolic = [](const Variable& x) { return tanh(x); };
    for (const DType dtype : {DType::float32, DType::float64}) {
        const double precision = dtype == DType::float32 ? 1e-6 : 1e-13;
        for (const double x : {3.0, 10.0, 20.0, 40.0}) {
            // exp(-x) is so small that it is the derivative up to a factor 1 + O(exp(-x)), which
            // the closed forms hold.
            const double e = std::exp(-x), sigmoid_slope = e / ((1.0 + e) * (1.0 + e));
            const double e2 = std::exp(-2.0 * x), tanh_slope = 4.0 * e2 / ((1.0 + e2) * (1.0 + e2));
            for (const double at : {x, -x}) {
                INFO(dtype << ", x = " << at);
                CHECK(derivative(sigmoid, at, 1, dtype) ==
                      Approx(sigmoid_slope).epsilon(precision));
                CHECK(derivative(softplus, at, 2, dtype) ==
                      Approx(sigmoid_slope).epsilon(precision));
                CHECK(derivative(hyperbolic, at, 1, dtype) ==
                      Approx(tanh_slope).epsilon(precision));
                CHECK(derivative(hyperbolic, at, 2, dtype) ==
                      Approx(-2.0 * std::tanh(at) * tanh_slope).epsilon(2.0 * precision));
            }
        }
    }
}

TEST_CASE("The cross-entropy of a confident and right logit keeps its relative precision",
          "[precision]") {
    for (const double x : {5.0, 20.0, 60.0}) {
        const double expected = std::log1p(std::exp(-x));
        const auto right = [](double target) {
            return [=](const Variable& logit) {
                return binary_cross_entropy_with_logits(logit,
                                                        Tensor::scalar(target, logit.dtype()));
            };
        };
        CHECK(derivative(right(1.0), x, 0, DType::float32) == Approx(expected).epsilon(1e-6));
        CHECK(derivative(right(0.0), -x, 0, DType::float32) == Approx(expected).epsilon(1e-6));
        CHECK(derivative(right(1.0), x, 1, DType::float32) ==
              Approx(-1.0 / (1.0 + std::exp(x))).epsilon(1e-6));
    }
}

TEST_CASE("A sum of a million equal numbers is a million times the number", "[precision]") {
    for (const std::int64_t count :
         {std::int64_t{1000}, std::int64_t{65536}, std::int64_t{1000003}}) {
        const Tensor numbers = Tensor::full({count}, 0.1);
        const double expected = static_cast<double>(count) * static_cast<double>(0.1F);
        CHECK(sum(Variable(numbers)).value().item() == Approx(expected).epsilon(1e-6));
    }
}

TEST_CASE("Directions of very long and very short vectors are those of float64", "[precision]") {
    const Tensor shape = Tensor::from({1, 4}, std::vector<float>{3.0F, -1.0F, 0.5F, 2.0F});
    const Tensor dL_dy = Tensor::from({1, 4}, std::vector<float>{0.2F, 1.0F, -0.7F, 0.4F});
    for (const double length : {1e-35, 1e-30, 1e-22, 1e-10, 1.0, 1e19, 1e30}) {
        const Variable single = Variable::leaf((Variable(shape) * length).value());
        const Variable precise = Variable::leaf(single.value().to(DType::float64));
        const Variable y = unit_channels(single, 1e-10),
                       expected = unit_channels_reference(precise, 1e-10);
        const auto gradient =
            grad(y, single, {.create_graph = false, .dL_dy = dL_dy}).value().to_vector();
        const auto expected_gradient =
            grad(expected, precise, {.create_graph = false, .dL_dy = dL_dy.to(DType::float64)})
                .value()
                .to_vector();
        INFO("length " << length);
        for (std::size_t i = 0; i < 4; ++i) {
            CHECK(y.value().to_vector()[i] ==
                  Approx(expected.value().to_vector()[i]).epsilon(1e-5));
            CHECK(gradient[i] == Approx(expected_gradient[i]).epsilon(1e-4));
        }
    }
}
