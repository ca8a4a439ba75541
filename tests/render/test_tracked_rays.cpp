#include <array>
#include <catch2/catch.hpp>

#include "core/error.h"
#include "render/tracked_rays.h"
#include "support/check_close.h"
#include "support/check_grad.h"

using namespace stymo;
using namespace stymo::test;

namespace {

const std::array poses{Pose{0.3, -0.2, 0.1, {1.4, 0.9, 5.0}},
                       Pose{-0.5, 0.1, -0.05, {-2.0, 0.2, 4.5}}};
const std::array intrinsics{Intrinsics{2.1, 0.52, 0.47}, Intrinsics{}};

std::vector<Camera> cameras() {
    return {camera_from_pose(poses[0], intrinsics[0]), camera_from_pose(poses[1], intrinsics[1])};
}

}  // namespace

TEST_CASE("tracked points are the samples of the cameras' rays", "[rays]") {
    const RaySampling sampling{.rays_per_side = 4, .samples_per_ray = 3};
    const RaySamples samples = sample_rays(cameras(), sampling, nullptr, DType::float64);
    const Tensor orbits = orbit_parameters(poses, DType::float64);
    const Variable points = tracked_points(Variable(orbits), cameras(), sampling, samples.depths);
    CHECK(check_close(points.value(), samples.points, 1e-12).passed);
}

TEST_CASE("gradients of tracked points are their finite differences", "[rays]") {
    const RaySampling sampling{.rays_per_side = 2, .samples_per_ray = 2};
    const Tensor depths = sample_rays(cameras(), sampling, nullptr, DType::float64).depths;
    const GradReport report =
        check_grad("tracked_points",
                   [&](const std::vector<Variable>& x) {
                       return tracked_points(x[0], cameras(), sampling, depths);
                   },
                   {orbit_parameters(poses, DType::float64)}, {.order = 1});
    INFO(report.message);
    CHECK(report.passed);
}

TEST_CASE("orbit parameters become the pose again, and turning them is an orbit", "[rays]") {
    Tensor orbits = orbit_parameters(poses, DType::float64);
    for (std::size_t i = 0; i < poses.size(); ++i) {
        const Pose pose = pose_from_orbit(orbits, static_cast<std::int64_t>(i));
        CHECK(pose.yaw == Approx(poses[i].yaw));
        CHECK(pose.pitch == Approx(poses[i].pitch));
        CHECK(pose.roll == Approx(poses[i].roll));
        for (std::size_t axis = 0; axis < 3; ++axis)
            CHECK(pose.translation[axis] == Approx(poses[i].translation[axis]));
    }
    const std::array frontal{Pose{}};
    Tensor turned = orbit_parameters(frontal, DType::float64);
    turned.mutable_values<double>()[0] = 0.4;
    const Pose expected = orbit_pose(0.4, 0.0, 0.0, 5.3);
    const Pose pose = pose_from_orbit(turned, 0);
    for (std::size_t axis = 0; axis < 3; ++axis)
        CHECK(pose.translation[axis] == Approx(expected.translation[axis]).margin(1e-12));
}

TEST_CASE("orbits that do not fit the cameras are refused", "[rays]") {
    const RaySampling sampling{.rays_per_side = 2, .samples_per_ray = 2};
    const Tensor depths = sample_rays(cameras(), sampling, nullptr).depths;
    const Variable one(orbit_parameters(std::array{Pose{}}));
    CHECK_THROWS_AS(tracked_points(one, cameras(), sampling, depths), ShapeError);
}
