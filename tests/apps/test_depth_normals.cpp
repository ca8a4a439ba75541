#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "apps/view/frame.h"
#include "core/error.h"

using namespace stymo;
using view::depth_normals;

namespace {

/// Depths of the plane through `on_plane` with this normal.
Tensor depths_of_plane(const Camera& camera, const RaySampling& sampling,
                       const Eigen::Vector3d& normal, const Eigen::Vector3d& on_plane) {
    const std::int64_t side = sampling.rays_per_side;
    std::vector<double> depths;
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Ray ray = camera_ray(camera, sampling, i / side, i % side);
        depths.push_back(normal.dot(on_plane - ray.origin) / normal.dot(ray.direction));
    }
    return Tensor::from({side, side, 1}, std::span<const double>(depths));
}

}  // namespace

TEST_CASE("every normal of a plane is the plane's, whatever the camera") {
    const RaySampling sampling{.rays_per_side = 9};
    const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.2, 1.0).normalized();
    for (const double yaw : {0.0, 0.4, -0.6}) {
        const Camera camera = camera_from_pose(orbit_pose(yaw, 0.1, 0.0, 5.3), {});
        const Tensor depth = depths_of_plane(camera, sampling, normal, {0.0, 0.1, 0.5});
        const Tensor normals = depth_normals(depth, camera, sampling);
        REQUIRE(normals.shape() == Shape{9, 9, 3});
        const auto values = normals.values<float>();
        for (std::size_t i = 0; i < values.size(); ++i)
            CHECK(values[i] == Approx(normal[static_cast<Eigen::Index>(i % 3)]).margin(1e-6));
    }
}

TEST_CASE("a depth map of another size than the rays is refused") {
    CHECK_THROWS_AS(depth_normals(Tensor::full({4, 4, 1}, 1.0), Camera{}, {.rays_per_side = 8}),
                    ShapeError);
}
