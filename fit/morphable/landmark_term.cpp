#include "fit/morphable/landmark_term.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "fit/morphable/state.h"

namespace stymo::morphable {

namespace {

constexpr std::size_t jaw_points = 17;

}  // namespace

LandmarkTerm::LandmarkTerm(const Contour& contour, Landmarks landmarks,
                           const Intrinsics& intrinsics, const MorphableFitOptions& options,
                           const std::array<bool, 68>& guessed)
    : contour_(&contour), landmarks_(std::move(landmarks)), intrinsics_(intrinsics) {
    constexpr double of_a_guess = 5.0;
    for (std::size_t k = 0; k < deviations_.size(); ++k)
        deviations_[k] = (k < jaw_points ? options.jaw_deviation : options.landmark_deviation) *
                         (guessed[k] ? of_a_guess : 1.0);
}

Landmarks LandmarkTerm::fitted(std::span<const double> state) const {
    const Camera camera = camera_from_pose(pose_of(state), intrinsics_);
    Landmarks result;
    for (std::size_t k = 0; k < result.size(); ++k)
        result[k] = project(camera, table_point(contour_->table(), rows_[k], state)).head<2>();
    return result;
}

void LandmarkTerm::hold(std::span<const double> state) {
    constexpr double linear_from = 2.5;
    rows_ = contour_->rows(table_points(contour_->table(), state),
                           camera_from_pose(pose_of(state), intrinsics_));
    const Landmarks seen = fitted(state);
    for (std::size_t k = 0; k < weights_.size(); ++k) {
        const double distance = (seen[k] - landmarks_[k]).norm() / deviations_[k];
        const double robust = distance > linear_from ? linear_from / distance : 1.0;
        weights_[k] = k < first_ ? 0.0 : robust / (deviations_[k] * deviations_[k]);
    }
}

double LandmarkTerm::cost(std::span<const double> state) const {
    const Landmarks seen = fitted(state);
    double sum = 0.0;
    for (std::size_t k = 0; k < seen.size(); ++k)
        sum += 0.5 * weights_[k] * (seen[k] - landmarks_[k]).squaredNorm();
    return sum;
}

void LandmarkTerm::add_to(NormalEquations& equations, std::span<const double> state) const {
    const VertexTable& table = contour_->table();
    std::vector<double> pose_rows;
    std::vector<double> point_rows;
    for (const std::size_t row : rows_) {
        pose_rows.insert(pose_rows.end(), state.begin(), state.begin() + pose_size);
        const Eigen::Vector3d point = table_point(table, row, state);
        point_rows.insert(point_rows.end(), point.begin(), point.end());
    }
    const std::array<Variable, 2> leaves{
        Variable::leaf(Tensor::from({68, 6}, std::span<const double>(pose_rows))),
        Variable::leaf(Tensor::from({68, 3}, std::span<const double>(point_rows)))};
    const Variable seen = image_points(camera_points(leaves[0], leaves[1]), intrinsics_);
    std::vector<double> row(texture_begin);
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const std::vector<Variable> jacobian =
            grad(sum(column(seen, static_cast<std::int64_t>(axis))), leaves);
        const auto by_pose = jacobian[0].value().values<double>();
        const auto by_point = jacobian[1].value().values<double>();
        for (std::size_t k = 0; k < rows_.size(); ++k) {
            if (weights_[k] == 0.0) continue;
            std::copy_n(&by_pose[pose_size * k], pose_size, row.begin());
            Eigen::Map<Eigen::RowVectorXd>(&row[identity_begin], shape_size) =
                Eigen::Map<const Eigen::RowVector3d>(&by_point[3 * k])
                    .lazyProduct(table.shape_rows(rows_[k]).cast<double>());
            const double given = landmarks_[k][static_cast<Eigen::Index>(axis)];
            equations.add(row, 0, seen.value().values<double>()[2 * k + axis] - given, weights_[k]);
        }
    }
}

std::array<double, 6> affine_pose(const Contour& contour, const Landmarks& landmarks,
                                  const Intrinsics& intrinsics) {
    // The best affine camera: coordinates = affine (point, 1), by linear least squares.
    const auto count = static_cast<Eigen::Index>(landmarks.size() - jaw_points);
    const Eigen::Map<const Eigen::Matrix3Xf> points(&contour.table().mean[3 * jaw_points], 3,
                                                    count);
    const Eigen::Map<const Eigen::Matrix2Xd> seen(landmarks[jaw_points].data(), 2, count);
    const Eigen::MatrixX4d rows = points.cast<double>().transpose().rowwise().homogeneous();
    const Eigen::Matrix<double, 2, 4> affine =
        (rows.transpose() * rows).ldlt().solve(rows.transpose() * seen.transpose()).transpose();
    // The nearest orthonormal rows to A are (A A^T)^(-1/2) A.
    const Eigen::Matrix<double, 2, 3> linear = affine.leftCols<3>();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> square;
    square.computeDirect(linear * linear.transpose());
    if (!(square.eigenvalues().prod() > 1e-16))
        fail<ValueError>("[morphable fit] the landmarks are not finite or lie all on one line");
    const double scale = 0.5 * square.operatorSqrt().trace();
    const Eigen::Matrix<double, 2, 3> axes = square.operatorInverseSqrt() * linear;
    const Eigen::Vector3d right = axes.row(0);
    const Eigen::Vector3d up = -axes.row(1);
    Eigen::Matrix3d rotation;
    rotation << right, up, right.cross(up);
    const Eigen::Vector3d angles = angles_from_rotation(rotation);
    return {angles[0],
            angles[1],
            angles[2],
            (affine(0, 3) - intrinsics.center_x) / scale,
            (affine(1, 3) - intrinsics.center_y) / scale,
            intrinsics.focal / scale};
}

}  // namespace stymo::morphable
