#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "core/rng.h"
#include "nn/engine/compositing.h"
#include "nn/engine/sample_selection.h"
#include "nn/realtime/density_grid.h"

using namespace stymo;

namespace {

SampleSelection selected(const std::vector<DensityBounds>& bounds, float delta, float tolerance) {
    SampleSelection selection;
    selection.resize(1, static_cast<std::int64_t>(bounds.size()));
    select_samples(bounds, 0, delta, tolerance, 0, selection);
    return selection;
}

/// Logits x + 2 y + 3 z.
void slope(std::span<const float> points, std::span<float> logits) {
    for (std::size_t i = 0; i < logits.size(); ++i)
        logits[i] = points[3 * i] + 2.0F * points[3 * i + 1] + 3.0F * points[3 * i + 2];
}

void densities_of_slope(std::span<const float> points, std::span<float> densities) {
    slope(points, densities);
    std::ranges::transform(densities, densities.begin(), [](float x) { return softplus(x); });
}

}  // namespace

TEST_CASE("samples left out in a row have less weight than the tolerance, if the bounds hold",
          "[realtime]") {
    Rng rng(1);
    for (int trial = 0; trial < 50; ++trial) {
        const std::vector<double> draws =
            rng.uniform({64, 3}, 0.0, 1.0, DType::float64).to_vector();
        std::vector<DensityBounds> bounds;
        for (std::size_t i = 0; i < 64; ++i) {
            const auto density = static_cast<float>(std::pow(draws[3 * i], 6.0) * 20.0);
            bounds.push_back({density * static_cast<float>(draws[3 * i + 1]), density,
                              density * (1.0F + static_cast<float>(draws[3 * i + 2]))});
        }
        const float delta = 0.1F, tolerance = 0.05F;
        const SampleSelection selection = selected(bounds, delta, tolerance);
        double transmittance = 1.0, left_out = 0.0, gap = 0.0;
        std::size_t next = 0;
        for (std::size_t i = 0; i < bounds.size(); ++i) {
            const double weight = transmittance * (1.0 - std::exp(-bounds[i].estimate * delta));
            transmittance -= weight;
            if (next < static_cast<std::size_t>(selection.counts[0]) &&
                selection.samples[next] == static_cast<std::int32_t>(i)) {
                CHECK(selection.gaps[next] == Approx(gap).margin(1e-6));
                left_out = gap = 0.0;
                ++next;
            } else {
                left_out += weight;
                gap += bounds[i].estimate * delta;
            }
            CHECK(left_out < tolerance);
        }
        CHECK(next == static_cast<std::size_t>(selection.counts[0]));
        CHECK(next < 64);
        CHECK(selection.tails[0] == Approx(gap).margin(1e-6));
    }
}

TEST_CASE(
    "nothing is left out at tolerance 0 or where nothing is known, everything where there is "
    "nothing",
    "[realtime]") {
    const std::vector<DensityBounds> empty(8),
        unknown(8, {0.0F, 0.0F, std::numeric_limits<float>::infinity()});
    CHECK(selected(empty, 0.1F, 0.0F).counts[0] == 8);
    CHECK(selected(unknown, 0.1F, 0.5F).counts[0] == 8);
    CHECK(selected(empty, 0.1F, 0.01F).counts[0] == 0);
}

TEST_CASE("a density grid bounds what it has learnt and nothing else", "[realtime]") {
    DensityGrid grid(1.0, 0.3);
    const std::vector<float> points{0.1F, 0.2F, 0.3F, -0.9F, 0.8F, 0.1F, 1.7F, 0.0F, 0.0F};
    std::vector<DensityBounds> bounds(3);
    CHECK_FALSE(grid.bounds(points, bounds));
    CHECK(std::isinf(bounds[0].upper));

    grid.evaluate_around(points, slope);
    CHECK(grid.known_vertices() == 16);
    CHECK(grid.bounds(points, bounds));
    std::vector<float> densities(3);
    densities_of_slope(points, densities);
    for (std::size_t i = 0; i < 2; ++i) {
        CHECK(bounds[i].lower <= densities[i]);
        CHECK(bounds[i].estimate == Approx(densities[i]).margin(1e-5));
        CHECK(bounds[i].upper >= densities[i]);
        CHECK(bounds[i].upper - bounds[i].lower <= Approx(6.0 * 0.3));
    }
    CHECK(bounds[2].lower == 0.0F);
    CHECK(std::isinf(bounds[2].upper));

    grid.evaluate_around(points, slope);
    CHECK(grid.known_vertices() == 16);
    grid.forget();
    CHECK_FALSE(grid.bounds(points, bounds));
}

TEST_CASE("a density grid knows nothing of what could not be evaluated", "[realtime]") {
    DensityGrid grid(1.0, 0.3);
    const std::vector<float> points{0.1F, 0.2F, 0.3F};
    std::vector<DensityBounds> bounds(1);
    const auto fails = [](std::span<const float>, std::span<float>) {
        throw std::runtime_error("stopped");
    };
    const auto not_a_number = [](std::span<const float>, std::span<float> logits) {
        std::ranges::fill(logits, std::numeric_limits<float>::quiet_NaN());
    };
    CHECK_THROWS_AS(grid.evaluate_around(points, fails), std::runtime_error);
    CHECK_THROWS_AS(grid.evaluate_around(points, not_a_number), stymo::NumericError);
    CHECK(grid.known_vertices() == 0);
    CHECK_FALSE(grid.bounds(points, bounds));
    CHECK(std::isinf(bounds[0].upper));
}

TEST_CASE("samples outside the known range of a ray are left out at any tolerance", "[realtime]") {
    SampleSelection selection;
    selection.resize(2, 8);
    const std::vector<DensityBounds> bounds(3, {1.0F, 1.0F, 1.0F});
    select_samples(bounds, 4, 0.1F, 0.0F, 1, selection);
    selection.keep_range(0, 6, 8);
    CHECK(std::ranges::equal(selection.samples_of(1), std::vector{4, 5, 6}));
    CHECK(std::ranges::equal(selection.samples_of(0), std::vector{6, 7}));
    selection.keep_range(1, 0, 0);
    CHECK(selection.samples_of(1).empty());
}
