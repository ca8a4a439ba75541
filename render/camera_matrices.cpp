#include "render/camera_matrices.h"

#include <cmath>

#include "core/error.h"

namespace stymo {
namespace {

/// Of entries that were rounded on their way through a text file.
constexpr double rounding = 1e-3;

bool near(double a, double b) {
    return std::abs(a - b) <= rounding;
}

void require_rotation(const Matrix3& matrix) {
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            double product = 0.0;
            for (std::size_t k = 0; k < 3; ++k) product += matrix[k][i] * matrix[k][j];
            if (!near(product, i == j ? 1.0 : 0.0)) fail<ValueError>("its rotation is not orthonormal");
        }
    }
    const auto& [x, y, z] = matrix;
    const double handedness =
        x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) + x[2] * (y[0] * z[1] - y[1] * z[0]);
    if (handedness < 0.0) fail<ValueError>("its axes are left-handed");
}

Vector3 forward_of(const Camera& camera) {
    return {camera.world_from_camera[0][2], camera.world_from_camera[1][2], camera.world_from_camera[2][2]};
}

}  // namespace

Matrix4 world_from_camera_matrix(const Camera& camera) {
    Matrix4 matrix{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) matrix[i][j] = camera.world_from_camera[i][j];
        matrix[i][3] = camera.center[i];
    }
    matrix[3][3] = 1.0;
    return matrix;
}

Matrix34 camera_from_world_matrix(const Camera& camera) {
    Matrix34 matrix{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            matrix[i][j] = camera.world_from_camera[j][i];
            matrix[i][3] -= camera.world_from_camera[j][i] * camera.center[j];
        }
    }
    return matrix;
}

Camera camera_from_matrix(const Matrix4& world_from_camera, const Intrinsics& intrinsics) {
    const auto& last = world_from_camera[3];
    if (!near(last[0], 0.0) || !near(last[1], 0.0) || !near(last[2], 0.0) || !near(last[3], 1.0))
        fail<ValueError>("its last row is not 0 0 0 1");
    Camera camera{intrinsics, {}, {}};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) camera.world_from_camera[i][j] = world_from_camera[i][j];
        camera.center[i] = world_from_camera[i][3];
    }
    require_rotation(camera.world_from_camera);
    return camera;
}

Camera camera_from_matrix(const Matrix34& camera_from_world, const Intrinsics& intrinsics) {
    Camera camera{intrinsics, {}, {}};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            camera.world_from_camera[i][j] = camera_from_world[j][i];
            camera.center[i] -= camera_from_world[j][i] * camera_from_world[j][3];
        }
    }
    require_rotation(camera.world_from_camera);
    return camera;
}

Camera with_focal(Camera camera, double focal) {
    const Vector3 forward = forward_of(camera);
    double depth = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) depth -= forward[axis] * camera.center[axis];
    const double way = depth * (1.0 - focal / camera.intrinsics.focal);
    for (std::size_t axis = 0; axis < 3; ++axis) camera.center[axis] += way * forward[axis];
    camera.intrinsics.focal = focal;
    return camera;
}

Eg3dLabel eg3d_label(const Camera& camera) {
    Camera scaled = with_focal(camera, eg3d_focal);
    for (double& coordinate : scaled.center) coordinate /= eg3d_unit;
    const Matrix4 matrix = world_from_camera_matrix(scaled);
    Eg3dLabel label{};
    for (std::size_t i = 0; i < 16; ++i) label[i] = matrix[i / 4][i % 4];
    label[16] = label[20] = scaled.intrinsics.focal;
    label[18] = scaled.intrinsics.center_x;
    label[21] = scaled.intrinsics.center_y;
    label[24] = 1.0;
    return label;
}

Camera camera_from_eg3d(std::span<const double, 25> label) {
    Matrix4 matrix{};
    for (std::size_t i = 0; i < 16; ++i) matrix[i / 4][i % 4] = label[i];
    const auto intrinsics = label.subspan<16, 9>();
    const bool upper = near(intrinsics[1], 0.0) && near(intrinsics[3], 0.0) && near(intrinsics[6], 0.0) &&
                       near(intrinsics[7], 0.0) && near(intrinsics[8], 1.0);
    constexpr double largest_focal = 100.0;  // in units of the image's side; more are pixels
    if (!upper || !(intrinsics[0] > 0.0) || intrinsics[0] > largest_focal || !near(intrinsics[4] / intrinsics[0], 1.0))
        fail<ValueError>("its last 9 numbers are no normalised intrinsics");
    Camera camera = camera_from_matrix(matrix, {intrinsics[0], intrinsics[2], intrinsics[5]});
    for (double& coordinate : camera.center) coordinate *= eg3d_unit;
    return camera;
}

}  // namespace stymo
