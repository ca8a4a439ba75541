#include <catch2/catch.hpp>

#include "apps/view/off_axis_camera.h"
#include "core/error.h"

using namespace stymo;

namespace {

const Window window{.center = {0.2, -0.1, 0.5}, .side = 3.0};

/// Where the line from the eye to a point meets the window's plane, in image coordinates: by
/// similar triangles.
Eigen::Vector2d seen_through(const Eigen::Vector3d& eye, const Eigen::Vector3d& point) {
    const double part = (eye.z() - window.center.z()) / (eye.z() - point.z());
    const Eigen::Vector3d hit = eye + part * (point - eye);
    return {0.5 + (hit.x() - window.center.x()) / window.side,
            0.5 - (hit.y() - window.center.y()) / window.side};
}

}  // namespace

TEST_CASE("a point in the window's plane stays where it is when the eye moves", "[off_axis]") {
    for (const Eigen::Vector3d& eye :
         {Eigen::Vector3d(0.2, -0.1, 6.0), Eigen::Vector3d(3.0, 1.0, 4.0),
          Eigen::Vector3d(-2.0, 2.5, 0.7)}) {
        const Camera camera = off_axis_camera(window, eye);
        // The corners of the window are those of the image.
        const Eigen::Vector3d first =
            project(camera, window.center + Eigen::Vector3d(-1.5, 1.5, 0.0));
        const Eigen::Vector3d last =
            project(camera, window.center + Eigen::Vector3d(1.5, -1.5, 0.0));
        CHECK(first.x() == Approx(0.0).margin(1e-12));
        CHECK(first.y() == Approx(0.0).margin(1e-12));
        CHECK(last.x() == Approx(1.0));
        CHECK(last.y() == Approx(1.0));
        CHECK(first.z() == Approx(eye.z() - window.center.z()));
    }
}

TEST_CASE("a point behind or before the window is seen where its line of sight meets it",
          "[off_axis]") {
    for (const Eigen::Vector3d& eye :
         {Eigen::Vector3d(0.2, -0.1, 6.0), Eigen::Vector3d(3.0, 1.0, 4.0)}) {
        for (const Eigen::Vector3d& point :
             {Eigen::Vector3d(0.3, 0.4, -2.0), Eigen::Vector3d(-0.5, 0.2, 1.5)}) {
            const Eigen::Vector3d seen = project(off_axis_camera(window, eye), point);
            const Eigen::Vector2d expected = seen_through(eye, point);
            CHECK(seen.x() == Approx(expected.x()));
            CHECK(seen.y() == Approx(expected.y()));
        }
    }
}

TEST_CASE("before the middle of the window the camera is an ordinary one", "[off_axis]") {
    const Camera camera = off_axis_camera({.side = 5.3 / 2.03}, {0.0, 0.0, 5.3});
    CHECK(camera.intrinsics.focal == Approx(2.03));
    CHECK(camera.intrinsics.center_x == Approx(0.5));
    CHECK(camera.intrinsics.center_y == Approx(0.5));
    CHECK(pose_from_camera(camera).yaw == 0.0);
}

TEST_CASE("an eye in the window's plane or behind it is refused", "[off_axis]") {
    CHECK_THROWS_AS(off_axis_camera(window, {0.0, 0.0, 0.5}), ValueError);
    CHECK_THROWS_AS(off_axis_camera(window, {0.0, 0.0, -1.0}), ValueError);
}
