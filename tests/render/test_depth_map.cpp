#include <catch2/catch.hpp>

#include "render/depth_map.h"

using namespace stymo;

namespace {

/// Distances to the plane z = height of the world.
Tensor depths_of_plane(const Camera& camera, std::int64_t side, double height) {
    Tensor depths({side, side, 1});
    const auto values = depths.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Eigen::Vector2d image_point((double(i % side) + 0.5) / double(side),
                                          (double(i / side) + 0.5) / double(side));
        const Eigen::Vector3d direction =
            camera.world_from_camera * direction_at(camera.intrinsics, image_point);
        values[static_cast<std::size_t>(i)] =
            static_cast<float>((height - camera.center[2]) / direction[2]);
    }
    return depths;
}

}  // namespace

TEST_CASE("the point that a depth map shows at an image point projects to it", "[depth_map]") {
    const Camera camera = camera_from_pose(orbit_pose(0.4, -0.2, 0.1, 5.3), {});
    const Tensor depths = depths_of_plane(camera, 32, 0.3);
    for (const Eigen::Vector2d& image_point :
         {Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(0.11, 0.83), Eigen::Vector2d(0.7, 0.3)}) {
        const Eigen::Vector3d point = point_at(camera, depths, image_point);
        CHECK(point[2] == Approx(0.3).margin(1e-3));
        CHECK((project(camera, point).head<2>() - image_point).norm() < 1e-9);
        CHECK(depth_at(depths, image_point) == Approx((point - camera.center).norm()));
    }
}

TEST_CASE("beyond the middles of its outer pixels a depth map is constant", "[depth_map]") {
    const Tensor depths = depths_of_plane(camera_from_pose({}, {}), 8, 0.0);
    CHECK(depth_at(depths, {0.0, 0.0}) == depths.values<float>()[0]);
    CHECK(depth_at(depths, {1.0, 1.0}) == depths.values<float>()[63]);
}
