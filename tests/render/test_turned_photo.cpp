#include <catch2/catch.hpp>
#include <cmath>

#include "render/depth_map.h"
#include "render/turned_photo.h"

namespace turned_photo_tests {

using namespace stymo;

namespace {

constexpr std::int64_t side = 96, rays = 48;

Eigen::Vector2d place_of(std::int64_t index, std::int64_t count) {
    return {(double(index % count) + 0.5) / double(count),
            (double(index / count) + 0.5) / double(count)};
}

/// The point of the plane z = 0 that the camera sees.
Eigen::Vector3d plane_point(const Camera& camera, const Eigen::Vector2d& place) {
    const Eigen::Vector3d direction =
        camera.world_from_camera * direction_at(camera.intrinsics, place);
    return camera.center - camera.center[2] / direction[2] * direction;
}

/// Smooth colours of the world's plane z = 0.
double color_at(const Eigen::Vector3d& point, std::int64_t channel) {
    return 0.5 * std::sin(1.3 * point[0] + static_cast<double>(channel)) + 0.3 * point[1];
}

/// The plane as a camera sees it, wholly on the head; `color` in place of its colours if not NaN.
SeenFace plane_seen_from(const Camera& camera, double color = std::nan("")) {
    SeenFace seen{camera, Tensor({side, side, 3}), Tensor::full({side, side, 1}, 1.0),
                  Tensor({rays, rays, 1})};
    for (std::int64_t i = 0; i < rays * rays; ++i) {
        seen.depth.mutable_values<float>()[static_cast<std::size_t>(i)] =
            static_cast<float>((plane_point(camera, place_of(i, rays)) - camera.center).norm());
    }
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Eigen::Vector3d point = plane_point(camera, place_of(i, side));
        for (std::int64_t channel = 0; channel < 3; ++channel)
            seen.image.mutable_values<float>()[static_cast<std::size_t>(3 * i + channel)] =
                static_cast<float>(std::isnan(color) ? color_at(point, channel) : color);
    }
    return seen;
}

double share_at(const TurnedPhoto& turned, std::int64_t row, std::int64_t column) {
    return turned.seen.values<float>()[static_cast<std::size_t>(row * side + column)];
}

}  // namespace

TEST_CASE("a turned photo has the photo's colours at the view's points", "[turned_photo]") {
    const SeenFace photo = plane_seen_from(camera_from_pose({}, {}));
    const SeenFace view =
        plane_seen_from(camera_from_pose(orbit_pose(0.4, 0.1, 0.0, 5.3), {}), 7.0);
    const TurnedPhoto turned = turned_photo(photo, view);
    double worst = 0.0, shares = 0.0;
    for (std::int64_t i = 0; i < side * side; ++i) {
        const double share = turned.seen.values<float>()[static_cast<std::size_t>(i)];
        const Eigen::Vector3d point = plane_point(view.camera, place_of(i, side));
        shares += share;
        // A depth map ends half a ray before its image does.
        const Eigen::Vector2d place = place_of(i, side);
        if (place.minCoeff() < 0.03 || place.maxCoeff() > 0.97) continue;
        for (std::int64_t channel = 0; channel < 3; ++channel) {
            const double expected = 7.0 + share * (color_at(point, channel) - 7.0);
            worst = std::max(
                worst,
                std::abs(turned.image.values<float>()[static_cast<std::size_t>(3 * i + channel)] -
                         expected));
        }
    }
    CHECK(worst < 0.01);
    CHECK(shares > 0.7 * side * side);
    CHECK(share_at(turned, side / 2, side / 2) == 1.0);
}

TEST_CASE("a turned photo leaves out what it does not show", "[turned_photo]") {
    const Camera front = camera_from_pose({}, {});
    const SeenFace view =
        plane_seen_from(camera_from_pose(orbit_pose(0.2, 0.0, 0.0, 5.3), {}), 7.0);
    SeenFace photo = plane_seen_from(front);
    // Something stands before the left half in the photo; its upper part is not the head.
    for (std::int64_t i = 0; i < rays * rays; ++i)
        if (i % rays < rays / 2)
            photo.depth.mutable_values<float>()[static_cast<std::size_t>(i)] *= 0.9F;
    for (std::int64_t i = 0; i < side * side / 4; ++i)
        photo.mask.mutable_values<float>()[static_cast<std::size_t>(i)] = 0.0F;
    const TurnedPhoto turned = turned_photo(photo, view);
    CHECK(share_at(turned, side * 3 / 5, side / 4) == 0.0);
    CHECK(share_at(turned, side * 3 / 5, side * 3 / 4) == 1.0);
    CHECK(share_at(turned, side / 8, side * 3 / 4) == 0.0);
    CHECK(turned.image.values<float>()[0] == 7.0F);
}

}  // namespace turned_photo_tests
