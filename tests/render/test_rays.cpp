#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/parallel.h"
#include "render/rays.h"
#include "support/error_message.h"

using namespace stymo;

namespace {

Camera frontal(double distance) {
    return camera_from_pose(orbit_pose(0, 0, 0, distance), Intrinsics{});
}

/// One element of a (B, R * N, 3) tensor of points.
Eigen::Vector3d point_at(const RaySamples& samples, std::int64_t index) {
    const auto values = samples.points.values<double>();
    const auto first = static_cast<std::size_t>(3 * index);
    return Eigen::Vector3d(&values[first]);
}

}  // namespace

TEST_CASE("every sample projects to the middle of its pixel", "[rays]") {
    const Camera camera =
        camera_from_pose(Pose{0.3, -0.2, 0.1, {1.4, 0.9, 5.0}}, Intrinsics{2.1, 0.52, 0.47});
    RaySampling sampling{.rays_per_side = 4, .samples_per_ray = 3};
    for (const bool pixel_centers : {true, false}) {
        sampling.pixel_centers = pixel_centers;
        const RaySamples samples = sample_rays({camera}, sampling, nullptr, DType::float64);
        REQUIRE(samples.points.shape() == Shape{1, 48, 3});
        for (std::int64_t i = 0; i < 48; ++i) {
            const std::int64_t ray = i / 3;
            const double offset = pixel_centers ? 0.5 : 0.0;
            const Eigen::Vector3d seen = project(camera, point_at(samples, i));
            CHECK(seen[0] == Approx((static_cast<double>(ray % 4) + offset) / 4).margin(1e-12));
            CHECK(seen[1] == Approx((static_cast<double>(ray / 4) + offset) / 4).margin(1e-12));
        }
    }
}

TEST_CASE("depths start on the near plane and their intervals reach the far plane", "[rays]") {
    const Camera camera = camera_from_pose(orbit_pose(0.4, 0.2, 0, 5.3), Intrinsics{});
    const RaySampling sampling{.rays_per_side = 3, .samples_per_ray = 6};
    const RaySamples samples = sample_rays({camera}, sampling, nullptr, DType::float64);
    const auto depths = samples.depths.values<double>();
    const auto deltas = samples.deltas.values<double>();
    for (std::int64_t ray = 0; ray < 9; ++ray) {
        for (std::int64_t k = 0; k < 6; ++k) {
            // 6 intervals of 6 units: planes z = 2.5, 1.5, ..., -2.5, and the seventh, -3.5, closes
            // the last interval.
            const std::int64_t index = 6 * ray + k;
            const auto flat = static_cast<std::size_t>(index);
            const Eigen::Vector3d point = point_at(samples, index);
            CHECK(point[2] == Approx(2.5 - static_cast<double>(k)).margin(1e-12));
            CHECK(depths[flat] == Approx((point - camera.center).norm()));
            const double expected = k < 5 ? (point_at(samples, index + 1) - point).norm()
                                          : depths[flat] / (camera.center[2] - point[2]);
            CHECK(deltas[flat] == Approx(expected));
        }
    }
}

TEST_CASE("the middle ray of a frontal camera has the depths of the planes", "[rays]") {
    const RaySamples samples = sample_rays(
        {frontal(5.3)}, {.rays_per_side = 1, .samples_per_ray = 2}, nullptr, DType::float64);
    const auto depths = samples.depths.values<double>();
    const auto deltas = samples.deltas.values<double>();
    CHECK(depths[0] == Approx(2.8));
    CHECK(depths[1] == Approx(5.8));
    CHECK(deltas[0] == Approx(3.0));
    CHECK(deltas[1] == Approx(3.0));
}

TEST_CASE("jittered samples stay in their strata, fill them, and add up to their intervals",
          "[rays]") {
    constexpr std::int64_t side = 16, count = 8;
    Rng rng(7);
    const RaySamples samples = sample_rays(
        {frontal(5.3)}, {.rays_per_side = side, .samples_per_ray = count}, &rng, DType::float64);
    const auto depths = samples.depths.values<double>();
    const auto deltas = samples.deltas.values<double>();
    std::vector<double> lowest(count, 1e9), highest(count, -1e9);
    for (std::int64_t ray = 0; ray < side * side; ++ray) {
        for (std::int64_t k = 0; k < count; ++k) {
            const auto flat = static_cast<std::size_t>(ray * count + k);
            // In units of the interval: sample k lies in [k - 1/2, k + 1/2], the first one in [0,
            // 1/2].
            const double position = (2.5 - point_at(samples, ray * count + k)[2]) / 6.0 * count;
            const auto stratum = static_cast<std::size_t>(k);
            lowest[stratum] = std::min(lowest[stratum], position - static_cast<double>(k));
            highest[stratum] = std::max(highest[stratum], position - static_cast<double>(k));
            CHECK(deltas[flat] > 0.0);
            if (k + 1 < count) {
                CHECK(depths[flat] + deltas[flat] == Approx(depths[flat + 1]));
            }
        }
    }
    for (std::size_t k = 0; k < count; ++k) {
        const double lower = k == 0 ? 0.0 : -0.5;
        CHECK(lowest[k] >= lower - 1e-12);
        CHECK(lowest[k] < lower + 0.05);
        CHECK(highest[k] <= 0.5 + 1e-12);
        CHECK(highest[k] > 0.45);
    }
}

TEST_CASE("the jitter does not depend on the number of threads", "[rays]") {
    const int threads_before = thread_count();
    std::vector<std::vector<double>> points;
    for (const int threads : {1, 4}) {
        set_thread_count(threads);
        Rng rng(3);
        points.push_back(sample_rays({frontal(5.3), frontal(6.0)},
                                     {.rays_per_side = 16, .samples_per_ray = 4}, &rng)
                             .points.to_vector());
    }
    set_thread_count(threads_before);
    CHECK(points[0] == points[1]);
}

TEST_CASE("planes along the optical axis serve a camera at the side", "[rays]") {
    const Camera camera =
        camera_from_pose(orbit_pose(std::numbers::pi / 2, 0, 0, 5.3), Intrinsics{});
    const RaySampling sampling{
        .rays_per_side = 4, .samples_per_ray = 3, .planes = DepthPlanes::optical_axis};
    const RaySamples samples = sample_rays({camera}, sampling, nullptr, DType::float64);
    for (std::int64_t i = 0; i < 48; ++i) {
        // The camera stands on +x, so its planes are x = 2.5, 0.5 and -1.5.
        CHECK(point_at(samples, i)[0] ==
              Approx(2.5 - 2.0 * static_cast<double>(i % 3)).margin(1e-12));
    }
}

TEST_CASE("both kinds of planes agree for a frontal camera", "[rays]") {
    const auto world = sample_rays({frontal(5.3)}, {.rays_per_side = 5, .samples_per_ray = 4},
                                   nullptr, DType::float64);
    const auto optical =
        sample_rays({frontal(5.3)},
                    {.rays_per_side = 5, .samples_per_ray = 4, .planes = DepthPlanes::optical_axis},
                    nullptr, DType::float64);
    const auto expected = world.points.to_vector(), actual = optical.points.to_vector();
    for (std::size_t i = 0; i < expected.size(); ++i) {
        CHECK(actual[i] == Approx(expected[i]).margin(1e-12));
    }
}

TEST_CASE("a near plane behind the camera is moved to the camera", "[rays]") {
    const RaySamples samples = sample_rays(
        {frontal(1.0)}, {.rays_per_side = 1, .samples_per_ray = 3}, nullptr, DType::float64);
    const auto depths = samples.depths.values<double>();
    CHECK(depths[0] == 0.0);
    CHECK(depths[1] == Approx(1.5));
    CHECK(depths[2] == Approx(3.0));
}

TEST_CASE("rays that cannot be sampled are refused", "[rays]") {
    const Camera side = camera_from_pose(orbit_pose(std::numbers::pi / 2, 0, 0, 5.3), Intrinsics{});
    CHECK_THROWS_AS(sample_rays({side}, RaySampling{}, nullptr), ValueError);
    CHECK_THROWS_AS(sample_rays({frontal(-4.0)}, RaySampling{}, nullptr), ValueError);
    CHECK_THROWS_AS(sample_rays({}, RaySampling{}, nullptr), ValueError);
    CHECK_THROWS_AS(sample_rays({frontal(5.3)}, {.samples_per_ray = 1}, nullptr), ValueError);
    CHECK_THROWS_AS(sample_rays({frontal(5.3)}, {.rays_per_side = 0}, nullptr), ValueError);
    CHECK_THROWS_AS(sample_rays({frontal(5.3)}, {.near_z = -3.5, .far_z = 2.5}, nullptr),
                    ValueError);
}

TEST_CASE("a ray along the planes is refused with advice that the sampling does not follow yet",
          "[rays]") {
    RaySampling sampling{.rays_per_side = 4, .samples_per_ray = 4};
    const auto advice = [&](const Camera& camera) {
        return test::error_message<ValueError>(
            [&] { static_cast<void>(sample_rays({camera}, sampling, nullptr)); });
    };
    const Camera aside = camera_from_pose(orbit_pose(std::numbers::pi / 2.0, 0.0, 0.0, 5.3), {});
    CHECK_THAT(advice(aside), Catch::EndsWith("use planes along the optical axis for a camera this "
                                              "far to the side"));
    sampling.planes = DepthPlanes::optical_axis;
    CHECK(advice(aside).empty());
    const Camera wide = camera_from_pose(orbit_pose(0.0, 0.0, 0.0, 5.3), {.focal = 1e-3});
    CHECK_THAT(advice(wide), Catch::EndsWith("use a longer focal length"));
}
