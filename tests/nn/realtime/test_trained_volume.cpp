#include <catch2/catch.hpp>
#include <cmath>

#include "nn/realtime/field_source.h"
#include "nn/realtime/view.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace trained_volume_tests {

namespace {

Camera camera_at(const CameraConfig& config, double yaw, double times) {
    return camera_from_pose(pivot_pose(yaw, 0.1, 0.05, times * config.distance, config.pivot_depth),
                            config.intrinsics);
}

/// Samples of all rays in the volume, and all samples.
std::pair<std::int64_t, std::int64_t> counted(const CameraConfig& config, const Camera& camera) {
    RaySampling sampling = tiny_model_config().decoder.rays;
    sampling.planes = DepthPlanes::optical_axis;
    std::int64_t inside = 0;
    const std::int64_t side = sampling.rays_per_side, samples = 16;
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Ray ray = camera_ray(camera, sampling, i / side, i % side);
        const SampleRange range = samples_in_trained_volume(config, camera, ray, samples);
        inside += range.end - range.first;
        // The range holds just the samples whose image in the trained camera lies within its
        // border.
        const Camera trained = camera_from_pose(
            pivot_pose(0.0, 0.0, 0.0, config.distance, config.pivot_depth), config.intrinsics);
        for (std::int64_t k = 0; k < samples; ++k) {
            const Eigen::Vector3d point =
                ray.origin + sample_distance(ray, k, samples) * ray.direction;
            const Eigen::Vector3d pivot(0.0, 0.0, config.pivot_depth);
            Eigen::Vector3d turned = camera.world_from_camera.transpose() * (point - pivot);
            turned = trained.world_from_camera * turned + pivot;
            const Eigen::Vector3d image = project(trained, turned);
            const double margin =
                std::max(std::abs(image[0] - 0.5), std::abs(image[1] - 0.5)) - 0.625;
            if (std::abs(margin) < 1e-9) continue;
            CHECK((margin < 0.0) == (k >= range.first && k < range.end));
        }
    }
    return {inside, side * side * samples};
}

}  // namespace

TEST_CASE("the trained volume holds all samples of usual cameras, and little of what is far",
          "[realtime]") {
    const CameraConfig config = tiny_model_config().camera;
    for (const double yaw : {-0.7, 0.0, 1.3}) {
        for (const double times : {0.8, 1.0, 1.1}) {
            const auto [inside, all] = counted(config, camera_at(config, yaw, times));
            CHECK(inside == all);
        }
        const auto [inside, all] = counted(config, camera_at(config, yaw, 4.0));
        CHECK(inside > 0);
        CHECK(inside < all / 4);
    }
}

}  // namespace trained_volume_tests
