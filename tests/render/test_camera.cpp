#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "render/camera.h"

using namespace stymo;

namespace {

constexpr double half_turn = std::numbers::pi;

void check_vectors(const Eigen::Vector3d& actual, const Eigen::Vector3d& expected) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        CHECK(actual[axis] == Approx(expected[axis]).margin(1e-12));
    }
}

void check_matrices(const Eigen::Matrix3d& actual, const Eigen::Matrix3d& expected) {
    for (int column = 0; column < 3; ++column) {
        check_vectors(actual.col(column), expected.col(column));
    }
}

}  // namespace

TEST_CASE("each angle turns about its own axis by the right-hand rule", "[camera]") {
    check_matrices(rotation_from_angles(half_turn / 2, 0, 0),
                   Eigen::Matrix3d{{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}});
    check_matrices(rotation_from_angles(0, half_turn / 2, 0),
                   Eigen::Matrix3d{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}});
    check_matrices(rotation_from_angles(0, 0, half_turn / 2),
                   Eigen::Matrix3d{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}});
}

TEST_CASE("pitch is applied first, then yaw, then roll", "[camera]") {
    // Rz(90) Ry(90) Rx(90) by hand.
    check_matrices(rotation_from_angles(half_turn / 2, half_turn / 2, half_turn / 2),
                   Eigen::Matrix3d{{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}});
    // Rz(90) Rx(90): the x axis goes to y, the y axis to z.
    check_matrices(rotation_from_angles(0, half_turn / 2, half_turn / 2),
                   Eigen::Matrix3d{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}});
}

TEST_CASE("angles survive the way through a rotation matrix", "[camera]") {
    for (double yaw = -1.5; yaw < 1.6; yaw += 0.3) {
        for (double pitch = -3.1; pitch < 3.2; pitch += 0.5) {
            for (double roll = -3.1; roll < 3.2; roll += 0.5) {
                check_vectors(angles_from_rotation(rotation_from_angles(yaw, pitch, roll)),
                              {yaw, pitch, roll});
            }
        }
    }
}

TEST_CASE("at gimbal lock the angles have no roll and give the same rotation", "[camera]") {
    for (const double yaw : {half_turn / 2, -half_turn / 2}) {
        const Eigen::Matrix3d rotation = rotation_from_angles(yaw, 0.4, 0.9);
        const Eigen::Vector3d angles = angles_from_rotation(rotation);
        CHECK(angles[2] == 0.0);
        check_matrices(rotation_from_angles(angles[0], angles[1], angles[2]), rotation);
    }
}

TEST_CASE("the frontal camera looks at the origin", "[camera]") {
    const Camera camera = camera_from_pose(Pose{}, Intrinsics{});
    check_matrices(camera.world_from_camera, Eigen::Matrix3d{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}});
    check_vectors(project(camera, {0, 0, 0}), {0.5, 0.5, 5.3});
}

TEST_CASE("points project to the numbers of a pinhole camera", "[camera]") {
    const Camera camera = camera_from_pose(Pose{0, 0, 0, {0, 0, 4}}, Intrinsics{2.0, 0.5, 0.25});
    // 1 to the right and 0.5 up, at depth 4: half a side to the right, a quarter up, which is
    // towards smaller y.
    check_vectors(project(camera, {1.0, 0.5, 0.0}), {1.0, 0.0, 4.0});
    // The same point nearer to the camera is farther from the centre.
    check_vectors(project(camera, {1.0, 0.5, 2.0}), {1.5, -0.25, 2.0});
}

TEST_CASE("an orbiting camera keeps its distance and the origin in its centre", "[camera]") {
    for (const double roll : {0.0, 0.3}) {
        const Pose pose = orbit_pose(0.7, -0.4, roll, 5.3);
        check_vectors(project(camera_from_pose(pose, Intrinsics{}), {0, 0, 0}), {0.5, 0.5, 5.3});
    }
    // A camera at yaw 90 degrees stands on the +x axis; one at pitch 90 degrees stands below, on
    // -y.
    check_vectors(orbit_pose(half_turn / 2, 0, 0, 2.0).translation, {2, 0, 0});
    check_vectors(orbit_pose(0, half_turn / 2, 0, 2.0).translation, {0, -2, 0});
}

TEST_CASE("positive angles turn the face to the image's left, up and clockwise", "[camera]") {
    const auto seen = [](double yaw, double pitch, double roll, const Eigen::Vector3d& point) {
        return project(camera_from_pose(orbit_pose(yaw, pitch, roll, 5.3), Intrinsics{}), point);
    };
    const Eigen::Vector3d nose{0, 0, 1}, top{0, 1, 0};
    CHECK(seen(0.3, 0, 0, nose)[0] < 0.5);
    CHECK(seen(0, 0.3, 0, nose)[1] < 0.5);
    CHECK(seen(0, 0, 0.3, top)[0] > 0.5);
}

TEST_CASE("a mirrored pose sees the mirrored point at the mirrored position", "[camera]") {
    const Pose pose{0.4, -0.2, 0.3, {1.0, 0.5, 5.0}};
    const Eigen::Vector3d seen = project(camera_from_pose(pose, Intrinsics{}), {0.3, 0.2, -0.1});
    const Eigen::Vector3d mirror_seen =
        project(camera_from_pose(mirrored(pose), Intrinsics{}), {-0.3, 0.2, -0.1});
    check_vectors(mirror_seen, {1.0 - seen[0], seen[1], seen[2]});
}

TEST_CASE(
    "a pivot pose keeps the pivot in the middle of the image at its distance, whatever the angles",
    "[camera]") {
    const double distance = 5.3, pivot_depth = 0.9;
    for (const double yaw : {-1.1, 0.0, 0.4}) {
        for (const double pitch : {-0.6, 0.0, 0.3}) {
            for (const double roll : {-0.2, 0.5}) {
                const Pose pose = pivot_pose(yaw, pitch, roll, distance, pivot_depth);
                check_vectors(project(camera_from_pose(pose, Intrinsics{}), {0, 0, pivot_depth}),
                              {0.5, 0.5, distance - pivot_depth});
            }
        }
    }
    check_vectors(pivot_pose(0, 0, 0, distance, pivot_depth).translation, {0, 0, distance});
    check_vectors(pivot_pose(half_turn / 2, 0, 0, distance, pivot_depth).translation,
                  {distance - pivot_depth, 0, pivot_depth});
}
