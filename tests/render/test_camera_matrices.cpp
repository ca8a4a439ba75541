#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/error.h"
#include "render/camera_matrices.h"

using namespace stymo;

namespace {

constexpr double degree = std::numbers::pi / 180.0;

void check_same(const Camera& a, const Camera& b) {
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
            CHECK(a.world_from_camera(i, j) == Approx(b.world_from_camera(i, j)).margin(1e-12));
        CHECK(a.center[i] == Approx(b.center[i]).margin(1e-12));
    }
    CHECK(a.intrinsics.focal == Approx(b.intrinsics.focal));
}

Camera some_camera() {
    return camera_from_pose(Pose{0.3, -0.2, 0.1, {1.4, 0.9, 5.0}}, {});
}

}  // namespace

TEST_CASE("the frontal pose is EG3D's frontal label", "[camera]") {
    // NVlabs/eg3d: a camera at (0, 0, 2.7) that looks along -z, with y down.
    const Eg3dLabel expected{1, 0, 0, 0,      0, -1,  0, 0,      0,   0, -1, 2.7, 0,
                             0, 0, 1, 4.2647, 0, 0.5, 0, 4.2647, 0.5, 0, 0,  1};
    const Eg3dLabel label = eg3d_label(camera_from_pose(Pose{}, {}));
    for (std::size_t i = 0; i < label.size(); ++i)
        CHECK(label[i] == Approx(expected[i]).margin(1e-9));
}

TEST_CASE("an orbit stays an orbit at EG3D's distance", "[camera]") {
    const Eg3dLabel label =
        eg3d_label(camera_from_pose(orbit_pose(30 * degree, 10 * degree, 0, 5.3), {}));
    CHECK(std::hypot(label[3], label[7], label[11]) == Approx(2.7));
    // A camera on the world's x side sees the face turned to the image's left.
    CHECK(label[3] > 0.0);
}

TEST_CASE("cameras come back from every form they are written in", "[camera]") {
    const Camera camera = some_camera();
    check_same(camera_from_matrix(world_from_camera_matrix(camera), camera.intrinsics), camera);
    check_same(camera_from_matrix(camera_from_world_matrix(camera), camera.intrinsics), camera);
    check_same(with_focal(camera_from_eg3d(eg3d_label(camera)), camera.intrinsics.focal), camera);
}

TEST_CASE("a camera with another focal length shows the origin at the same position and size",
          "[camera]") {
    const Camera camera = some_camera();
    const Camera other = with_focal(camera, 4.0);
    const Eigen::Vector3d seen = project(camera, {0, 0, 0});
    const Eigen::Vector3d seen_by_other = project(other, {0, 0, 0});
    CHECK(seen_by_other[2] / other.intrinsics.focal == Approx(seen[2] / camera.intrinsics.focal));
    const Eigen::Vector3d left = project(camera_from_pose(Pose{}, {}), {0.01, 0, 0});
    const Eigen::Vector3d left_of_other =
        project(with_focal(camera_from_pose(Pose{}, {}), 4.0), {0.01, 0, 0});
    CHECK(left_of_other[0] == Approx(left[0]));
}

TEST_CASE("the matrix that takes the world to the camera does what project does", "[camera]") {
    const Camera camera = some_camera();
    const Eigen::Matrix<double, 3, 4> matrix = camera_from_world_matrix(camera);
    const Eigen::Vector3d point{0.3, -0.4, 0.8};
    const Eigen::Vector3d seen = matrix * point.homogeneous();
    const Eigen::Vector3d expected = project(camera, point);
    CHECK(camera.intrinsics.focal * seen[0] / seen[2] + camera.intrinsics.center_x ==
          Approx(expected[0]));
    CHECK(camera.intrinsics.focal * seen[1] / seen[2] + camera.intrinsics.center_y ==
          Approx(expected[1]));
    CHECK(seen[2] == Approx(expected[2]));
}

TEST_CASE("numbers that are no camera are refused", "[camera]") {
    Eigen::Matrix4d scaled = world_from_camera_matrix(some_camera());
    scaled.col(0) *= 2.0;
    CHECK_THROWS_AS(camera_from_matrix(scaled, {}), ValueError);
    Eigen::Matrix4d left_handed = world_from_camera_matrix(some_camera());
    left_handed.col(0) *= -1.0;
    CHECK_THROWS_AS(camera_from_matrix(left_handed, {}), ValueError);
    for (const double far : {1e7, 1e300, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
        Eigen::Matrix4d away = world_from_camera_matrix(some_camera());
        away(0, 3) = far;
        CHECK_THROWS_AS(camera_from_matrix(away, {}), ValueError);
    }
    Eg3dLabel pixels = eg3d_label(some_camera());
    pixels[16] = pixels[20] = 2985.0;
    CHECK_THROWS_AS(camera_from_eg3d(pixels), ValueError);
}
