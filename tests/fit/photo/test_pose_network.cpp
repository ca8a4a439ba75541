#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "fit/photo/pose_network.h"
#include "shared_data.h"
#include "support/error_message.h"

namespace pose_network_tests {

using namespace stymo;
namespace fs = std::filesystem;

namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// The first 12 outputs of 3DDFA_V2 for a head turned by `image_from_head` (y up), with its scale
/// and its translation.
std::array<float, 12> outputs_for(const Eigen::Matrix3d& image_from_head) {
    std::array<float, 12> outputs{};
    Eigen::Map<Eigen::Matrix<float, 3, 4, Eigen::RowMajor>>{outputs.data()}
        << (6e-4 * image_from_head).cast<float>(),
        Eigen::Vector3f::Constant(60.0F);
    return outputs;
}

/// (yaw, pitch, roll) in degrees.
Eigen::Vector3d degrees_of(const Eigen::Matrix3d& rotation) {
    return angles_from_rotation(rotation) / degree;
}

void check_angles(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& expected) {
    const Eigen::Vector3d angles = degrees_of(rotation);
    for (std::size_t i = 0; i < 3; ++i) CHECK(angles[i] == Approx(expected[i]).margin(1e-4));
}

}  // namespace

TEST_CASE("3DDFA's turns of the head become the opposite turns of the camera", "[photo]") {
    // By hand, y up: the nose, the head's z axis, is the last column.
    const double c = std::cos(30 * degree), s = std::sin(30 * degree);
    const Eigen::Matrix3d nose_to_the_right{{c, 0, s}, {0, 1, 0}, {-s, 0, c}};
    const Eigen::Matrix3d nose_down{{1, 0, 0}, {0, c, -s}, {0, s, c}};
    const Eigen::Matrix3d clockwise{{c, s, 0}, {-s, c, 0}, {0, 0, 1}};
    check_angles(rotation_from_3ddfa(outputs_for(nose_to_the_right)), {-30, 0, 0});
    check_angles(rotation_from_3ddfa(outputs_for(nose_down)), {0, -30, 0});
    check_angles(rotation_from_3ddfa(outputs_for(clockwise)), {0, 0, 30});
}

TEST_CASE("the head's axes are seen where 3DDFA's matrix puts them", "[photo]") {
    const Eigen::Matrix3d image_from_head = rotation_from_angles(0.6, -0.3, 0.2);
    const Eigen::Vector3d angles =
        angles_from_rotation(rotation_from_3ddfa(outputs_for(image_from_head)));
    // From far away a perspective image is a scaled orthographic one.
    const double distance = 1e4;
    const Camera camera = camera_from_pose(
        pivot_pose(angles[0], angles[1], angles[2], distance, 0.0), {distance, 0.0, 0.0});
    for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d seen = project(camera, Eigen::Vector3d::Unit(axis));
        CHECK(seen[0] == Approx(image_from_head(0, axis)).margin(1e-3));
        CHECK(seen[1] == Approx(-image_from_head(1, axis)).margin(1e-3));
    }
}

TEST_CASE("6DRepNet's matrix is the pose's rotation as it is", "[photo]") {
    const Eigen::Matrix3d expected = rotation_from_angles(0.5, -0.2, 0.1);
    const Eigen::Matrix3f columns = expected.transpose().cast<float>();
    check_angles(rotation_from_6drepnet({columns.data(), 9}),
                 {0.5 / degree, -0.2 / degree, 0.1 / degree});
    // Its last layer gives one axis, scaled, and another vector in the plane of it and the next.
    Eigen::Matrix<float, 6, 1> numbers;
    numbers << 2.0F * expected.col(0).cast<float>(),
        (0.7 * expected.col(1) - 0.3 * expected.col(0)).cast<float>();
    check_angles(rotation_from_6drepnet({numbers.data(), 6}),
                 {0.5 / degree, -0.2 / degree, 0.1 / degree});
    CHECK_THROWS_AS(rotation_from_6drepnet({numbers.data(), 5}), ShapeError);
}

TEST_CASE("the nearest rotation is orthonormal, right-handed, and leaves rotations alone",
          "[photo]") {
    const Eigen::Matrix3d skewed{{1.1, 0.1, 0.0}, {0.05, 0.8, -0.3}, {0.0, 0.4, 0.9}};
    const Eigen::Matrix3d rotation = nearest_rotation(skewed);
    const Eigen::Matrix3d identity = rotation * rotation.transpose();
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            CHECK(identity(i, j) == Approx(i == j ? 1.0 : 0.0).margin(1e-12));
    const Eigen::Matrix3d again = nearest_rotation(rotation);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) CHECK(again(i, j) == Approx(rotation(i, j)).margin(1e-12));
    // A reflection is not a rotation; the nearest one to this is the identity.
    const auto nearest_to_diagonal = [](double x, double y, double z) {
        return nearest_rotation(Eigen::Vector3d(x, y, z).asDiagonal());
    };
    CHECK(nearest_to_diagonal(1, 1, -0.1)(2, 2) == Approx(1.0));
    CHECK_THROWS_AS(nearest_to_diagonal(1, 0, 1), NumericError);
    CHECK_THROWS_AS(nearest_to_diagonal(1, std::numeric_limits<double>::quiet_NaN(), 1),
                    NumericError);
}

TEST_CASE("the medians of pitch and roll are subtracted, the yaw stays", "[photo]") {
    std::vector<Eigen::Matrix3d> rotations;
    for (const double turn : {-0.4, 0.1, 0.2})
        rotations.push_back(rotation_from_angles(turn, turn / 2 - 0.2, turn / 4));
    PoseStatistics report;
    const std::vector<Pose> poses = poses_from_rotations(rotations, PivotCamera{}, report);
    CHECK(report.pitch_offset == Approx((0.05 - 0.2) / degree));
    CHECK(report.roll_offset == Approx(0.025 / degree));
    CHECK(poses[0].yaw == Approx(-0.4));
    CHECK(poses[0].pitch == Approx(-0.25));
    CHECK(poses[1].pitch == Approx(0.0).margin(1e-12));
    CHECK(poses[2].roll == Approx(0.025));
    CHECK(report.yaw.lowest == Approx(-0.4 / degree));
    CHECK(report.yaw.highest == Approx(0.2 / degree));
    CHECK(report.yaw.mean == Approx(-0.1 / 3 / degree));
    CHECK(report.yaw.deviation == Approx(std::sqrt(0.21 / 3 - 0.01 / 9) / degree));
    CHECK(poses[2].translation[0] == Approx(4.4 * rotation_from_angles(0.2, 0.05, 0.025)(0, 2)));
}

TEST_CASE("a file that is not a pose network is refused in one line", "[photo]") {
    const ScratchFolder folder;
    write_file(folder.path() / "net.onnx", "not a network");
    CHECK_THROWS_AS(PoseNetwork(folder.path() / "none.onnx"), FileError);
    CHECK_THAT(test::error_message<Error>([&] { PoseNetwork(folder.path() / "net.onnx"); }),
               Catch::Contains("not an ONNX network"));
    const auto shared = shared_data();
    if (!shared) return;
    CHECK_THAT(
        test::error_message<Error>([&] { PoseNetwork(*shared / "weights/face_parser_unet.onnx"); }),
        Catch::Contains("not a known pose network (the network does not take images of 120 x 120"));
}

TEST_CASE("the network finds the yaw of real photos, and mirrored poses in mirrored photos",
          "[photo]") {
    const auto shared = shared_data();
    if (!shared) return;
    PoseNetwork network(*shared / "weights/pose_3ddfa_mb05.onnx");
    const auto photo = [&](const std::string& id) {
        return read_image(*shared / "data/celebamask/images" / (id + ".jpg"));
    };
    const auto pose_of = [&](const Tensor& image) {
        return degrees_of(network.rotation(network.face_box(image)));
    };
    for (const char* id : {"00000", "00010", "00025"})
        CHECK(pose_of(photo(id))[0] == Approx(-21).margin(4));
    const Eigen::Vector3d pose = pose_of(photo("00030"));
    CHECK(pose[0] == Approx(19).margin(4));
    const Eigen::Vector3d mirrored = pose_of(mirror_image(photo("00030")));
    CHECK(mirrored[0] == Approx(-pose[0]).margin(0.01));
    CHECK(mirrored[1] == Approx(pose[1]).margin(0.01));
    CHECK(mirrored[2] == Approx(-pose[2]).margin(0.01));
}

}  // namespace pose_network_tests
