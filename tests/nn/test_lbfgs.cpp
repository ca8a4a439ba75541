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
int minimised(Lbfgs& minimiser, const Objective& objective, double wanted = 0.0, int most_iterations = 500) {
    int evaluations = 0;
    const auto counted = [&](const std::vector<double>& x) {
        ++evaluations;
        return objective(x);
    };
    for (int i = 0; i < most_iterations && minimiser.step(counted, plenty); ++i) {
        if (minimiser.here()->value < wanted) break;
    }
    return evaluations;
}

ValueAndGradient rosenbrock(const std::vector<double>& x) {
    const double a = 1.0 - x[0], b = x[1] - x[0] * x[0];
    return {a * a + 100.0 * b * b, {-2.0 * a - 400.0 * x[0] * b, 200.0 * b}};
}

}  // namespace

TEST_CASE("L-BFGS finds the valley's end of Rosenbrock's function", "[lbfgs]") {
    Lbfgs minimiser({-1.2, 1.0});
    CHECK(minimised(minimiser, rosenbrock) < 120);
    CHECK(minimiser.point()[0] == Approx(1.0).epsilon(1e-8));
    CHECK(minimiser.point()[1] == Approx(1.0).epsilon(1e-8));
}

TEST_CASE("L-BFGS solves a quadratic function whose axes differ by four orders of magnitude", "[lbfgs]") {
    std::vector<double> scales, centre;
    for (int i = 0; i < 12; ++i) {
        scales.push_back(std::pow(10.0, i / 3.0));
        centre.push_back(std::cos(static_cast<double>(i)));
    }
    const auto bowl = [&](const std::vector<double>& x) {
        ValueAndGradient at;
        for (std::size_t i = 0; i < x.size(); ++i) {
            at.value += 0.5 * scales[i] * std::pow(x[i] - centre[i], 2);
            at.gradient.push_back(scales[i] * (x[i] - centre[i]));
        }
        return at;
    };
    Lbfgs minimiser(std::vector<double>(scales.size(), 0.0));
    // What follows would polish the last digits of a minimum that is 0.
    CHECK(minimised(minimiser, bowl, 1e-15) < 120);
    for (std::size_t i = 0; i < centre.size(); ++i) CHECK(minimiser.point()[i] == Approx(centre[i]).margin(1e-7));
}

TEST_CASE("L-BFGS comes close to a minimum at a kink, where no gradient is small", "[lbfgs]") {
    // |x| + 10 |y - x^2|, least at 0.
    const auto kinked = [](const std::vector<double>& x) {
        const double b = x[1] - x[0] * x[0];
        const double sign_a = x[0] < 0.0 ? -1.0 : 1.0, sign_b = b < 0.0 ? -1.0 : 1.0;
        return ValueAndGradient{std::abs(x[0]) + 10.0 * std::abs(b), {sign_a - 20.0 * x[0] * sign_b, 10.0 * sign_b}};
    };
    Lbfgs minimiser({1.3, -0.7});
    minimised(minimiser, kinked);
    CHECK(kinked(minimiser.point()).value < 1e-5);
}

TEST_CASE("The two loops of L-BFGS multiply by BFGS's own matrix", "[lbfgs]") {
    constexpr std::size_t n = 4;
    Rng rng(3);
    std::deque<CurvaturePair> pairs;
    for (int k = 0; k < 6; ++k) {
        CurvaturePair pair{rng.normal({n}, 0.0, 1.0).to_vector(), {}};
        // Changes of the gradient of a quadratic function, with some noise.
        const std::vector<double> noise = rng.normal({n}, 0.0, 0.05).to_vector();
        for (std::size_t i = 0; i < n; ++i)
            pair.gradient_change.push_back((1.0 + static_cast<double>(i)) * pair.step[i] + noise[i]);
        pairs.push_back(pair);
    }
    const auto dot = [](const std::vector<double>& a, const std::vector<double>& b) {
        double total = 0.0;
        for (std::size_t i = 0; i < n; ++i) total += a[i] * b[i];
        return total;
    };
    // H <- (I - r s y^T) H (I - r y s^T) + r s s^T with r = 1 / s y
    std::array<std::array<double, n>, n> h{};
    const CurvaturePair& last = pairs.back();
    for (std::size_t i = 0; i < n; ++i)
        h[i][i] = dot(last.step, last.gradient_change) / dot(last.gradient_change, last.gradient_change);
    for (const auto& [s, y] : pairs) {
        const double r = 1.0 / dot(s, y);
        std::array<std::array<double, n>, n> left{}, next{};
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t j = 0; j < n; ++j)
                for (std::size_t k = 0; k < n; ++k) left[i][j] += ((i == k ? 1.0 : 0.0) - r * s[i] * y[k]) * h[k][j];
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t j = 0; j < n; ++j) {
                next[i][j] = r * s[i] * s[j];
                for (std::size_t k = 0; k < n; ++k) next[i][j] += left[i][k] * ((k == j ? 1.0 : 0.0) - r * y[k] * s[j]);
            }
        h = next;
    }
    const std::vector<double> v = rng.normal({n}, 0.0, 1.0).to_vector();
    const std::vector<double> product = inverse_hessian_product(pairs, v);
    for (std::size_t i = 0; i < n; ++i) {
        double expected = 0.0;
        for (std::size_t j = 0; j < n; ++j) expected += h[i][j] * v[j];
        CHECK(product[i] == Approx(expected).epsilon(1e-10));
    }
    CHECK(inverse_hessian_product({}, v) == v);
}

TEST_CASE("Where a function is not finite, L-BFGS has gone too far and comes back", "[lbfgs]") {
    // x - log x has its minimum at 1 and is none for x <= 0.
    const auto barrier = [](const std::vector<double>& x) { return ValueAndGradient{x[0] - std::log(x[0]), {1.0 - 1.0 / x[0]}}; };
    Lbfgs minimiser({5.0}, {.first_step = 100.0});
    minimised(minimiser, barrier);
    CHECK(minimiser.point()[0] == Approx(1.0).epsilon(1e-7));
    Lbfgs outside({-1.0});
    CHECK_THROWS_AS(outside.step(barrier, plenty), NumericError);
    CHECK(outside.point() == std::vector<double>{-1.0});
}

TEST_CASE("L-BFGS keeps to its evaluations, and stays where nothing is lower", "[lbfgs]") {
    int evaluations = 0;
    const auto counted = [&](const std::vector<double>& x) {
        ++evaluations;
        return rosenbrock(x);
    };
    Lbfgs minimiser({-1.2, 1.0}, {.first_step = 1e6});
    CHECK_FALSE(minimiser.step(counted, 5));
    CHECK(evaluations == 5);
    CHECK(minimiser.point() == std::vector<double>{-1.2, 1.0});
    CHECK_FALSE(minimiser.step(counted, 0));
    CHECK(evaluations == 5);

    Lbfgs arrived({1.0, 1.0});
    CHECK_FALSE(arrived.step(rosenbrock, plenty));
    CHECK(arrived.here()->value == 0.0);
}

TEST_CASE("When the objective changes, L-BFGS goes on from where it is", "[lbfgs]") {
    Lbfgs minimiser({-1.2, 1.0});
    minimised(minimiser, rosenbrock, 0.0, 5);
    minimiser.objective_changed();
    CHECK_FALSE(minimiser.here().has_value());
    const auto moved = [](const std::vector<double>& x) {
        return ValueAndGradient{std::pow(x[0] - 3.0, 2) + std::pow(x[1] + 2.0, 2), {2.0 * (x[0] - 3.0), 2.0 * (x[1] + 2.0)}};
    };
    minimised(minimiser, moved);
    CHECK(minimiser.point()[0] == Approx(3.0));
    CHECK(minimiser.point()[1] == Approx(-2.0));
}
