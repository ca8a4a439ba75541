#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/rng.h"
#include "nn/optim/lbfgs.h"

using namespace stymo;

namespace {

constexpr int plenty = 1000;

/// Runs until the value is below `wanted` or nothing lower is found; the number of evaluations.
int minimised(Lbfgs& minimiser, const Objective& objective, double wanted = 0.0,
              int most_iterations = 500) {
    int evaluations = 0;
    const auto counted = [&](const Eigen::VectorXd& x) {
        ++evaluations;
        return objective(x);
    };
    for (int i = 0; i < most_iterations && minimiser.step(counted, plenty); ++i) {
        if (minimiser.current()->value < wanted) break;
    }
    return evaluations;
}

ValueAndGradient rosenbrock(const Eigen::VectorXd& x) {
    const double a = 1.0 - x[0], b = x[1] - x[0] * x[0];
    return {a * a + 100.0 * b * b, Eigen::Vector2d(-2.0 * a - 400.0 * x[0] * b, 200.0 * b)};
}

}  // namespace

TEST_CASE("L-BFGS finds the valley's end of Rosenbrock's function", "[lbfgs]") {
    Lbfgs minimiser(Eigen::Vector2d(-1.2, 1.0));
    CHECK(minimised(minimiser, rosenbrock) < 120);
    CHECK(minimiser.point()[0] == Approx(1.0).epsilon(1e-8));
    CHECK(minimiser.point()[1] == Approx(1.0).epsilon(1e-8));
}

TEST_CASE("L-BFGS solves a quadratic function whose axes differ by four orders of magnitude",
          "[lbfgs]") {
    const Eigen::VectorXd scales =
        Eigen::ArrayXd::LinSpaced(12, 0.0, 11.0 / 3.0).unaryExpr([](double x) {
            return std::pow(10.0, x);
        });
    const Eigen::VectorXd centre = Eigen::ArrayXd::LinSpaced(12, 0.0, 11.0).cos();
    const auto bowl = [&](const Eigen::VectorXd& x) {
        const Eigen::VectorXd gradient = scales.cwiseProduct(x - centre);
        return ValueAndGradient{0.5 * gradient.dot(x - centre), gradient};
    };
    Lbfgs minimiser(Eigen::VectorXd::Zero(12));
    // What follows would polish the last digits of a minimum that is 0.
    CHECK(minimised(minimiser, bowl, 1e-15) < 120);
    for (Eigen::Index i = 0; i < centre.size(); ++i)
        CHECK(minimiser.point()[i] == Approx(centre[i]).margin(1e-7));
}

TEST_CASE("L-BFGS comes close to a minimum at a kink, where no gradient is small", "[lbfgs]") {
    // |x| + 10 |y - x^2|, least at 0.
    const auto kinked = [](const Eigen::VectorXd& x) {
        const double b = x[1] - x[0] * x[0];
        const double sign_a = x[0] < 0.0 ? -1.0 : 1.0, sign_b = b < 0.0 ? -1.0 : 1.0;
        return ValueAndGradient{std::abs(x[0]) + 10.0 * std::abs(b),
                                Eigen::Vector2d(sign_a - 20.0 * x[0] * sign_b, 10.0 * sign_b)};
    };
    Lbfgs minimiser(Eigen::Vector2d(1.3, -0.7));
    minimised(minimiser, kinked);
    CHECK(kinked(minimiser.point()).value < 1e-5);
}

TEST_CASE("The two loops of L-BFGS multiply by BFGS's own matrix", "[lbfgs]") {
    constexpr int n = 4;
    Rng rng(3);
    const auto normal = [&](double deviation) -> Eigen::VectorXd {
        return Eigen::VectorXd::Map(rng.normal({n}, 0.0, deviation).to_vector().data(), n);
    };
    std::deque<CurvaturePair> pairs;
    for (int k = 0; k < 6; ++k) {
        const Eigen::VectorXd step = normal(1.0);
        // Changes of the gradient of a quadratic function, with some noise.
        const Eigen::VectorXd curvature = Eigen::VectorXd::LinSpaced(n, 1.0, n);
        pairs.push_back({step, curvature.cwiseProduct(step) + normal(0.05)});
    }
    // H <- (I - r s y^T) H (I - r y s^T) + r s s^T with r = 1 / s y
    const CurvaturePair& last = pairs.back();
    const Eigen::Matrix4d identity = Eigen::Matrix4d::Identity();
    Eigen::Matrix4d h =
        identity * last.step.dot(last.gradient_change) / last.gradient_change.squaredNorm();
    for (const auto& [s, y] : pairs) {
        const double r = 1.0 / s.dot(y);
        const Eigen::Matrix4d left = identity - r * s * y.transpose();
        h = (left * h * left.transpose() + r * s * s.transpose()).eval();
    }
    const Eigen::VectorXd v = normal(1.0);
    const Eigen::VectorXd product = inverse_hessian_product(pairs, v);
    const Eigen::VectorXd expected = h * v;
    for (int i = 0; i < n; ++i) CHECK(product[i] == Approx(expected[i]).epsilon(1e-10));
    CHECK(inverse_hessian_product({}, v) == v);
}

TEST_CASE("Where a function is not finite, L-BFGS has gone too far and comes back", "[lbfgs]") {
    // x - log x has its minimum at 1 and is none for x <= 0.
    const auto barrier = [](const Eigen::VectorXd& x) {
        return ValueAndGradient{x[0] - std::log(x[0]),
                                Eigen::VectorXd::Constant(1, 1.0 - 1.0 / x[0])};
    };
    Lbfgs minimiser(Eigen::VectorXd::Constant(1, 5.0), {.first_step = 100.0});
    minimised(minimiser, barrier);
    CHECK(minimiser.point()[0] == Approx(1.0).epsilon(1e-7));
    Lbfgs outside(Eigen::VectorXd::Constant(1, -1.0));
    CHECK_THROWS_AS(outside.step(barrier, plenty), NumericError);
    CHECK(outside.point() == Eigen::VectorXd::Constant(1, -1.0));
}

TEST_CASE("L-BFGS keeps to its evaluations, and stays where nothing is lower", "[lbfgs]") {
    int evaluations = 0;
    const auto counted = [&](const Eigen::VectorXd& x) {
        ++evaluations;
        return rosenbrock(x);
    };
    Lbfgs minimiser(Eigen::Vector2d(-1.2, 1.0), {.first_step = 1e6});
    CHECK_FALSE(minimiser.step(counted, 5));
    CHECK(evaluations == 5);
    CHECK(minimiser.point() == Eigen::Vector2d(-1.2, 1.0));
    CHECK_FALSE(minimiser.step(counted, 0));
    CHECK(evaluations == 5);

    Lbfgs arrived(Eigen::Vector2d(1.0, 1.0));
    CHECK_FALSE(arrived.step(rosenbrock, plenty));
    CHECK(arrived.current()->value == 0.0);
}

TEST_CASE("L-BFGS descends steeply where its estimate of the curvature gives no descent",
          "[lbfgs]") {
    // Step and change of the gradient are so large that their product overflows.
    const auto huge = [](const Eigen::VectorXd& x) {
        REQUIRE(x.allFinite());
        const double parts = x[0] / 1e160;
        const double slope = parts < 0.5 ? -1e150 : parts < 1.5 ? -5e149 : -1e149;
        return ValueAndGradient{10.0 - parts, Eigen::VectorXd::Constant(1, slope)};
    };
    Lbfgs minimiser(Eigen::VectorXd::Zero(1), {.first_step = 1e160, .decrease = 0.0});
    CHECK(minimiser.step(huge, plenty));
    CHECK(minimiser.current()->value == Approx(9.0));
    CHECK(minimiser.step(huge, plenty));
    CHECK(minimiser.current()->value == Approx(8.0));
}

TEST_CASE("L-BFGS stays where a value is not lower but equal", "[lbfgs]") {
    // The slope promises less than the rounding of the value.
    const auto flat = [](const Eigen::VectorXd&) {
        return ValueAndGradient{1.0, Eigen::VectorXd::Constant(1, 1e-20)};
    };
    Lbfgs minimiser(Eigen::VectorXd::Zero(1));
    CHECK_FALSE(minimiser.step(flat, plenty));
    CHECK(minimiser.point()[0] == 0.0);
}

TEST_CASE("When the objective changes, L-BFGS goes on from where it is", "[lbfgs]") {
    Lbfgs minimiser(Eigen::Vector2d(-1.2, 1.0));
    minimised(minimiser, rosenbrock, 0.0, 5);
    minimiser.objective_changed();
    CHECK_FALSE(minimiser.current().has_value());
    const auto moved = [](const Eigen::VectorXd& x) {
        return ValueAndGradient{std::pow(x[0] - 3.0, 2) + std::pow(x[1] + 2.0, 2),
                                Eigen::Vector2d(2.0 * (x[0] - 3.0), 2.0 * (x[1] + 2.0))};
    };
    minimised(minimiser, moved);
    CHECK(minimiser.point()[0] == Approx(3.0));
    CHECK(minimiser.point()[1] == Approx(-2.0));
}
