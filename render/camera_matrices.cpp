#include "render/camera_matrices.h"

#include <Eigen/Geometry>
#include <cmath>

#include "core/error.h"

namespace stymo {
namespace {

/// Tolerance for entries that were rounded when they were written to a text file.
constexpr double rounding = 1e-3;

template <int size>
using RowMajor = Eigen::Matrix<double, size, size, Eigen::RowMajor>;

bool near(double a, double b) {
    return std::abs(a - b) <= rounding;
}

Camera valid_camera(const Intrinsics& intrinsics, const Eigen::Matrix3d& world_from_camera,
                    const Eigen::Vector3d& center) {
    const Eigen::Matrix3d product = world_from_camera.transpose() * world_from_camera;
    if (!((product - Eigen::Matrix3d::Identity()).array().abs() <= rounding).all())
        fail<ValueError>("its rotation is not orthonormal");
    constexpr double farthest = 1e6;
    if (!(center.array().abs() <= farthest).all())
        fail<ValueError>("its centre is more than ", farthest, " from the origin");
    if (world_from_camera.determinant() < 0.0) fail<ValueError>("its axes are left-handed");
    return {intrinsics, world_from_camera, center};
}

}  // namespace

Eigen::Matrix4d world_from_camera_matrix(const Camera& camera) {
    Eigen::Matrix4d matrix;
    matrix << camera.world_from_camera, camera.center, Eigen::RowVector4d::Unit(3);
    return matrix;
}

Eigen::Matrix<double, 3, 4> camera_from_world_matrix(const Camera& camera) {
    const Eigen::Matrix3d camera_from_world = camera.world_from_camera.transpose();
    Eigen::Matrix<double, 3, 4> matrix;
    matrix << camera_from_world, -camera_from_world * camera.center;
    return matrix;
}

Camera camera_from_matrix(const Eigen::Matrix4d& world_from_camera, const Intrinsics& intrinsics) {
    const Eigen::RowVector4d error = world_from_camera.row(3) - Eigen::RowVector4d::Unit(3);
    if (!(error.array().abs() <= rounding).all()) fail<ValueError>("its last row is not 0 0 0 1");
    return valid_camera(intrinsics, world_from_camera.topLeftCorner<3, 3>(),
                        world_from_camera.topRightCorner<3, 1>());
}

Camera camera_from_matrix(const Eigen::Matrix<double, 3, 4>& camera_from_world,
                          const Intrinsics& intrinsics) {
    const Eigen::Matrix3d world_from_camera = camera_from_world.leftCols<3>().transpose();
    return valid_camera(intrinsics, world_from_camera,
                        -world_from_camera * camera_from_world.col(3));
}

Camera with_focal(Camera camera, double focal) {
    const Eigen::Vector3d forward = camera.world_from_camera.col(2);
    const double depth = -forward.dot(camera.center);
    camera.center += depth * (1.0 - focal / camera.intrinsics.focal) * forward;
    camera.intrinsics.focal = focal;
    return camera;
}

Eg3dLabel eg3d_label(const Camera& camera) {
    Camera scaled = with_focal(camera, eg3d_focal);
    scaled.center /= eg3d_unit;
    Eg3dLabel label{};
    Eigen::Map<RowMajor<4>>{label.data()} = world_from_camera_matrix(scaled);
    const auto& [focal, center_x, center_y] = scaled.intrinsics;
    Eigen::Map<RowMajor<3>>{&label[16]} =
        Eigen::Matrix3d{{focal, 0.0, center_x}, {0.0, focal, center_y}, {0.0, 0.0, 1.0}};
    return label;
}

Camera camera_from_eg3d(std::span<const double, 25> label) {
    const Eigen::Matrix3d matrix = Eigen::Map<const RowMajor<3>>(&label[16]);
    const Intrinsics intrinsics{matrix(0, 0), matrix(0, 2), matrix(1, 2)};
    const bool upper = near(matrix(0, 1), 0.0) && near(matrix(1, 0), 0.0) &&
                       near(matrix(2, 0), 0.0) && near(matrix(2, 1), 0.0) &&
                       near(matrix(2, 2), 1.0);
    constexpr double largest_focal = 100.0;  // in units of the image's side; more are pixels
    if (!upper || !(intrinsics.focal > 0.0) || intrinsics.focal > largest_focal ||
        !near(matrix(1, 1) / intrinsics.focal, 1.0))
        fail<ValueError>("its last 9 numbers are no normalised intrinsics");
    Camera camera = camera_from_matrix(Eigen::Matrix4d(Eigen::Map<const RowMajor<4>>(label.data())),
                                       intrinsics);
    camera.center *= eg3d_unit;
    return camera;
}

}  // namespace stymo
