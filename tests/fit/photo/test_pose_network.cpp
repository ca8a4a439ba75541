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
#include "fit/photo/network_poses.h"
#include "fit/photo/pose_network.h"
#include "shared_data.h"

using namespace stymo;
namespace fs = std::filesystem;

namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// The first 12 outputs of 3DDFA_V2 for a head turned by `picture_from_head` (y up), with its scale and its translation.
std::array<float, 12> outputs_for(const Matrix3& picture_from_head) {
    std::array<float, 12> outputs{};
    for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 3; ++column)
            outputs[4 * row + column] = static_cast<float>(6e-4 * picture_from_head[row][column]);
        outputs[4 * row + 3] = 60.0F;
    }
    return outputs;
}

/// (yaw, pitch, roll) in degrees.
Vector3 degrees_of(const Matrix3& rotation) {
    Vector3 angles = angles_from_rotation(rotation);
    for (double& angle : angles) angle /= degree;
    return angles;
}

void check_angles(const Matrix3& rotation, const Vector3& expected) {
    const Vector3 angles = degrees_of(rotation);
    for (std::size_t i = 0; i < 3; ++i) CHECK(angles[i] == Approx(expected[i]).margin(1e-4));
}

Matrix3 product_with_transpose(const Matrix3& matrix) {
    Matrix3 result{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            for (std::size_t k = 0; k < 3; ++k) result[i][j] += matrix[i][k] * matrix[j][k];
    return result;
}

std::string message_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

}  // namespace

TEST_CASE("3DDFA's turns of the head become the opposite turns of the camera", "[photo]") {
    // By hand, y up: the nose, the head's z axis, is the last column.
    const double c = std::cos(30 * degree), s = std::sin(30 * degree);
    const Matrix3 nose_to_the_right{{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}};
    const Matrix3 nose_down{{{1, 0, 0}, {0, c, -s}, {0, s, c}}};
    const Matrix3 clockwise{{{c, s, 0}, {-s, c, 0}, {0, 0, 1}}};
    check_angles(rotation_from_3ddfa(outputs_for(nose_to_the_right)), {-30, 0, 0});
    check_angles(rotation_from_3ddfa(outputs_for(nose_down)), {0, -30, 0});
    check_angles(rotation_from_3ddfa(outputs_for(clockwise)), {0, 0, 30});
}

TEST_CASE("the head's axes are seen where 3DDFA's matrix puts them", "[photo]") {
    const Matrix3 picture_from_head = rotation_from_angles(0.6, -0.3, 0.2);
    const Vector3 angles = angles_from_rotation(rotation_from_3ddfa(outputs_for(picture_from_head)));
    // From far away a perspective picture is a scaled orthographic one.
    const double distance = 1e4;
    const Camera camera = camera_from_pose(pivot_pose(angles[0], angles[1], angles[2], distance, 0.0), {distance, 0.0, 0.0});
    for (std::size_t axis = 0; axis < 3; ++axis) {
        Vector3 tip{};
        tip[axis] = 1.0;
        const Vector3 seen = project(camera, tip);
        CHECK(seen[0] == Approx(picture_from_head[0][axis]).margin(1e-3));
        CHECK(seen[1] == Approx(-picture_from_head[1][axis]).margin(1e-3));
    }
}

TEST_CASE("6DRepNet's matrix is the pose's rotation as it is", "[photo]") {
    const Matrix3 expected = rotation_from_angles(0.5, -0.2, 0.1);
    std::array<float, 9> outputs{};
    for (std::size_t i = 0; i < 9; ++i) outputs[i] = static_cast<float>(expected[i / 3][i % 3]);
    check_angles(rotation_from_6drepnet(outputs), {0.5 / degree, -0.2 / degree, 0.1 / degree});
}

TEST_CASE("the nearest rotation is orthonormal, right-handed, and leaves rotations alone", "[photo]") {
    const Matrix3 skewed{{{1.1, 0.1, 0.0}, {0.05, 0.8, -0.3}, {0.0, 0.4, 0.9}}};
    const Matrix3 rotation = nearest_rotation(skewed);
    const Matrix3 identity = product_with_transpose(rotation);
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) CHECK(identity[i][j] == Approx(i == j ? 1.0 : 0.0).margin(1e-12));
    const Matrix3 again = nearest_rotation(rotation);
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) CHECK(again[i][j] == Approx(rotation[i][j]).margin(1e-12));
    // A reflection is not a rotation; the nearest one to this is the identity.
    CHECK(nearest_rotation({{{1, 0, 0}, {0, 1, 0}, {0, 0, -0.1}}})[2][2] == Approx(1.0));
    CHECK_THROWS_AS(nearest_rotation({{{1, 0, 0}, {0, 0, 0}, {0, 0, 1}}}), NumericError);
    CHECK_THROWS_AS(nearest_rotation({{{1, 0, 0}, {0, std::numeric_limits<double>::quiet_NaN(), 0}, {0, 0, 1}}}), NumericError);
}

TEST_CASE("the medians of pitch and roll are subtracted, the yaw stays", "[photo]") {
    std::vector<Matrix3> rotations;
    for (const double turn : {-0.4, 0.1, 0.2}) rotations.push_back(rotation_from_angles(turn, turn / 2 - 0.2, turn / 4));
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
    CHECK(poses[2].translation[0] == Approx(4.4 * rotation_from_angles(0.2, 0.05, 0.025)[0][2]));
}

TEST_CASE("a file that is not a pose network is refused in one line", "[photo]") {
    const ScratchFolder folder;
    write_text_file(folder.path() / "net.onnx", "not a network");
    CHECK_THROWS_AS(PoseNetwork(folder.path() / "none.onnx"), FileError);
    CHECK_THAT(message_of([&] { PoseNetwork(folder.path() / "net.onnx"); }), Catch::Contains("not an ONNX network"));
    const auto shared = shared_data();
    if (!shared) return;
    CHECK_THAT(message_of([&] { PoseNetwork(*shared / "weights/face_parser_unet.onnx"); }),
               Catch::Contains("not a known pose network"));
}

TEST_CASE("the network finds the yaw of real photos, and mirrored poses in mirrored photos", "[photo]") {
    const auto shared = shared_data();
    if (!shared) return;
    PoseNetwork network(*shared / "weights/pose_3ddfa_mb05.onnx");
    const auto photo = [&](const std::string& id) { return read_image(*shared / "data/celebamask/images" / (id + ".jpg")); };
    const auto pose_of = [&](const Tensor& image) { return degrees_of(network.rotation(network.face_box(image))); };
    for (const char* id : {"00000", "00010", "00025"}) CHECK(pose_of(photo(id))[0] == Approx(-21).margin(4));
    const Vector3 pose = pose_of(photo("00030"));
    CHECK(pose[0] == Approx(19).margin(4));
    const Vector3 mirrored = pose_of(mirror_image(photo("00030")));
    CHECK(mirrored[0] == Approx(-pose[0]).margin(0.01));
    CHECK(mirrored[1] == Approx(pose[1]).margin(0.01));
    CHECK(mirrored[2] == Approx(-pose[2]).margin(0.01));
}
