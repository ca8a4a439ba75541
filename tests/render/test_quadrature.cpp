// Rules along a ray: closed forms against Gauss-Legendre, orders of convergence, bounds, the
// renderer's own rule.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <vector>

#include "render/quadrature.h"

using namespace stymo;

namespace {

const ProfileFamily family(const std::string& name) {
    const auto families = profile_families();
    return *std::ranges::find(families, name, &ProfileFamily::name);
}

QuadratureRule rule(const std::string& name) {
    const auto rules = quadrature_rules();
    return *std::ranges::find(rules, name, &QuadratureRule::name);
}

/// Eight nodes in each of many panels; at jumps the panels shrink by halves to both sides.
double integral(const RayProfile& ray, const std::function<double(double)>& f) {
    constexpr std::array<double, 4> nodes{0.1834346424956498, 0.5255324099163290,
                                          0.7966664774136267, 0.9602898564975363};
    constexpr std::array<double, 4> weights{0.3626837833783620, 0.3137066458778873,
                                            0.2223810344533745, 0.1012285362903763};
    std::vector<double> bounds{0.0, 1.0};
    for (int i = 1; i < 512; ++i) bounds.push_back(i / 512.0);
    for (const double jump : ray.jumps) {
        bounds.push_back(jump);
        for (double step = 0.5; step > 1e-15; step /= 2.0)
            for (const double bound : {jump - step, jump + step})
                if (bound > 0.0 && bound < 1.0) bounds.push_back(bound);
    }
    std::ranges::sort(bounds);
    double sum = 0.0;
    for (std::size_t i = 0; i + 1 < bounds.size(); ++i) {
        const double middle = (bounds[i] + bounds[i + 1]) / 2.0,
                     half = (bounds[i + 1] - bounds[i]) / 2.0;
        for (std::size_t k = 0; k < nodes.size(); ++k)
            sum += half * weights[k] * (f(middle - half * nodes[k]) + f(middle + half * nodes[k]));
    }
    return sum;
}

std::vector<double> colour_errors(const QuadratureRule& rule, const ProfileFamily& family,
                                  const std::vector<std::int64_t>& counts) {
    const std::vector<RayProfile> rays = spread_rays(family, 64);
    std::vector<double> errors;
    for (const std::int64_t count : counts)
        errors.push_back(
            quadrature_error(integrate(rule, cut(rule, rays, count, Rng(1))), rays).colour);
    return errors;
}

double order(const std::string& rule_name, const std::string& family_name) {
    const std::vector<std::int64_t> counts{64, 128, 256, 512};
    return observed_order(counts, colour_errors(rule(rule_name), family(family_name), counts),
                          1e-12)
        .value_or(0.0);
}

}  // namespace

TEST_CASE("The closed forms of the rays agree with Gauss-Legendre", "[quadrature]") {
    for (const ProfileFamily& one : profile_families()) {
        for (const double shift : {0.0, 0.37, 0.93}) {
            const RayProfile ray = one.ray(shift);
            INFO(one.name << ", shift " << shift);
            const auto weight = [&](double s) {
                return std::exp(-ray.optical_depth(s)) * ray.density(s);
            };
            // Positions within the wall are rounded to 1e-16, of which it makes optical depths of
            // 1e-8.
            const double tolerance = one.name == "wall" ? 1e-8 : 1e-12;
            const double depth = ray.optical_depth(1.0);
            CHECK(integral(ray, ray.density) == Approx(depth).epsilon(1e-12).margin(1e-14));
            CHECK(ray.exact.transmittance == Approx(std::exp(-depth)).margin(1e-15));
            CHECK(integral(ray, [&](double s) { return weight(s) * ray.colour(s); }) ==
                  Approx(ray.exact.colour).margin(tolerance));
        }
    }
}

TEST_CASE("The renderer's rule is the sum of equations (3) to (5) over N intervals",
          "[quadrature]") {
    const QuadratureRule renderers = quadrature_rules().front();
    for (const std::string name : {"fog", "two surfaces"}) {
        const std::vector<RayProfile> rays = spread_rays(family(name), 5);
        const std::int64_t count = 16;
        const auto results = integrate(renderers, cut(renderers, rays, count, Rng(1)));
        for (std::size_t i = 0; i < rays.size(); ++i) {
            double colour = 0.0, transmittance = 1.0;
            for (std::int64_t k = 0; k < count; ++k) {
                const double s = static_cast<double>(k) / static_cast<double>(count);
                const double alpha =
                    1.0 - std::exp(-rays[i].density(s) / static_cast<double>(count));
                colour += transmittance * alpha * rays[i].colour(s);
                transmittance *= 1.0 - alpha;
            }
            CHECK(results[i].colour == Approx(colour).margin(1e-13));
            CHECK(results[i].transmittance == Approx(transmittance).margin(1e-13));
        }
    }
}

TEST_CASE("Rules converge with their orders where the density is smooth", "[quadrature]") {
    CHECK(order("left rectangle", "fog") == Approx(1.0).margin(0.05));
    CHECK(order("jittered", "fog") == Approx(1.0).margin(0.1));
    CHECK(order("midpoint", "fog") == Approx(2.0).margin(0.05));
    CHECK(order("Euler", "fog") == Approx(1.0).margin(0.05));
}

TEST_CASE("The left rectangle is of second order where nothing is at both ends of a ray",
          "[quadrature]") {
    CHECK(order("left rectangle", "blob") == Approx(2.0).margin(0.05));
    const std::vector<std::int64_t> counts{64};
    const double left = colour_errors(rule("left rectangle"), family("blob"), counts).front();
    CHECK(left ==
          Approx(colour_errors(rule("midpoint"), family("blob"), counts).front()).epsilon(0.1));
}

TEST_CASE("At a surface every rule of equal steps is of first order", "[quadrature]") {
    for (const char* name : {"left rectangle", "jittered", "midpoint"}) {
        INFO(name);
        CHECK(order(name, "step") == Approx(1.0).margin(0.35));
    }
    CHECK(colour_errors(rule("left rectangle"), family("wall"), {64}).front() > 1e-3);
}

TEST_CASE(
    "Explicit Euler leaves [0, 1] beyond an optical depth of 1 a step, and every bound beyond 2",
    "[quadrature]") {
    const QuadratureRule euler = rule("Euler");
    const auto transmittance = [&](double x, std::size_t steps) {
        const std::vector<double> ones(steps, 1.0);
        return integrate(euler, {1, std::vector<double>(steps, x), ones, ones})
            .front()
            .transmittance;
    };
    CHECK(transmittance(0.9, 1) == Approx(0.1));
    CHECK(transmittance(1.5, 1) == Approx(-0.5));
    CHECK(std::abs(transmittance(1.9, 64)) < 1.0);
    CHECK(std::abs(transmittance(2.1, 64)) > 100.0);
}

TEST_CASE(
    "Transmittance and colour of the exponential form stay in [0, 1] for any density and any "
    "number of samples",
    "[quadrature]") {
    for (const QuadratureRule& one : quadrature_rules()) {
        if (one.euler) continue;
        for (const ProfileFamily& kind : profile_families()) {
            const std::vector<RayProfile> rays = spread_rays(kind, 8);
            for (const std::int64_t count : {2, 3, 17, 128}) {
                INFO(one.name << ", " << kind.name << ", " << count);
                const Intervals intervals = cut(one, rays, count, Rng(1));
                CHECK(std::ssize(intervals.density) == 8 * count);
                const auto results = integrate(one, intervals);
                const double above = one.dtype == DType::float32 ? 1.0 + 1e-6 : 1.0 + 1e-14;
                for (std::size_t i = 0; i < rays.size(); ++i) {
                    const bool bounded = results[i].transmittance >= 0.0 &&
                                         results[i].transmittance <= above &&
                                         results[i].colour >= 0.0 && results[i].colour <= above;
                    CHECK(bounded);
                }
            }
        }
    }
}

TEST_CASE(
    "The order of convergence is a slope without round-off and without what does not converge",
    "[quadrature]") {
    const std::vector<std::int64_t> counts{32, 64, 128, 256, 512, 1024};
    std::vector<double> errors;
    for (const std::int64_t count : counts)
        errors.push_back(3.0 * std::pow(static_cast<double>(count), -1.5));
    errors.front() = 100.0;
    CHECK(observed_order(counts, errors, 0.0).value_or(0.0) == Approx(1.5));
    errors.back() = 1e-15;
    CHECK(observed_order(counts, errors, 1e-13).value_or(0.0) == Approx(1.5));
    CHECK_FALSE(observed_order(counts, std::vector<double>(6, INFINITY), 0.0).has_value());
}
