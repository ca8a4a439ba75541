#include "fit/morphable/landmark_term.h"

#include <algorithm>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "fit/morphable/projection.h"
#include "fit/morphable/state.h"

namespace stymo::morphable {

namespace {

constexpr std::size_t jaw_points = 17;

}  // namespace

LandmarkTerm::LandmarkTerm(const Contour& contour, const Landmarks& landmarks, const Intrinsics& intrinsics,
                           const MorphableFitOptions& options)
    : contour_(&contour), landmarks_(landmarks), intrinsics_(intrinsics) {
    for (std::size_t k = 0; k < deviations_.size(); ++k)
        deviations_[k] = k < jaw_points ? options.jaw_deviation : options.landmark_deviation;
}

Landmarks LandmarkTerm::fitted(std::span<const double> state) const {
    const std::vector<double> points = table_points(contour_->table(), state);
    const Camera camera = camera_from_pose(pose_of(state), intrinsics_);
    Landmarks result{};
    for (std::size_t k = 0; k < result.size(); ++k) {
        const double* const point = &points[3 * rows_[k]];
        const Vector3 seen = project(camera, {point[0], point[1], point[2]});
        result[k] = {seen[0], seen[1]};
    }
    return result;
}

void LandmarkTerm::hold(std::span<const double> state) {
    constexpr double linear_from = 2.5;
    rows_ = contour_->rows(table_points(contour_->table(), state), camera_from_pose(pose_of(state), intrinsics_));
    const Landmarks seen = fitted(state);
    for (std::size_t k = 0; k < weights_.size(); ++k) {
        const double distance = std::hypot(seen[k][0] - landmarks_[k][0], seen[k][1] - landmarks_[k][1]) / deviations_[k];
        const double robust = distance > linear_from ? linear_from / distance : 1.0;
        weights_[k] = k < first_ ? 0.0 : robust / (deviations_[k] * deviations_[k]);
    }
}

double LandmarkTerm::cost(std::span<const double> state) const {
    const Landmarks seen = fitted(state);
    double sum = 0.0;
    for (std::size_t k = 0; k < seen.size(); ++k) {
        const double x = seen[k][0] - landmarks_[k][0];
        const double y = seen[k][1] - landmarks_[k][1];
        sum += 0.5 * weights_[k] * (x * x + y * y);
    }
    return sum;
}

void LandmarkTerm::add_to(NormalEquations& equations, std::span<const double> state) const {
    const VertexTable& table = contour_->table();
    const std::vector<double> points = table_points(table, state);
    std::vector<double> pose_rows;
    std::vector<double> point_rows;
    for (const std::size_t row : rows_) {
        pose_rows.insert(pose_rows.end(), state.begin(), state.begin() + pose_size);
        point_rows.insert(point_rows.end(), &points[3 * row], &points[3 * row] + 3);
    }
    const std::array<Variable, 2> leaves{Variable::leaf(Tensor::from({68, 6}, std::span<const double>(pose_rows))),
                                         Variable::leaf(Tensor::from({68, 3}, std::span<const double>(point_rows)))};
    const Variable seen = image_points(camera_points(leaves[0], leaves[1]), intrinsics_);
    std::vector<double> row(texture_begin);
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const std::vector<Variable> jacobian = grad(sum(column(seen, static_cast<std::int64_t>(axis))), leaves);
        const auto by_pose = jacobian[0].value().values<double>();
        const auto by_point = jacobian[1].value().values<double>();
        for (std::size_t k = 0; k < rows_.size(); ++k) {
            if (weights_[k] == 0.0) continue;
            std::copy_n(&by_pose[pose_size * k], pose_size, row.begin());
            for (std::size_t j = 0; j < shape_size; ++j) {
                double sum_over_axes = 0.0;
                for (std::size_t i = 0; i < 3; ++i)
                    sum_over_axes += by_point[3 * k + i] * static_cast<double>(table.shape_row(rows_[k], i)[j]);
                row[identity_begin + j] = sum_over_axes;
            }
            equations.add(row, 0, seen.value().values<double>()[2 * k + axis] - landmarks_[k][axis], weights_[k]);
        }
    }
}

std::array<double, 6> affine_pose(const Contour& contour, const Landmarks& landmarks, const Intrinsics& intrinsics) {
    // Each image axis: coordinate = a . point + b.
    std::array<std::array<double, 4>, 2> affine{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
        NormalEquations equations(4);
        for (std::size_t k = jaw_points; k < landmarks.size(); ++k) {
            const float* const point = &contour.table().mean[3 * k];
            const std::array<double, 4> row{static_cast<double>(point[0]), static_cast<double>(point[1]),
                                            static_cast<double>(point[2]), 1.0};
            equations.add(row, 0, -landmarks[k][axis], 1.0);
        }
        std::ranges::copy(damped_step(equations, 0.0, std::vector<bool>(4, false)), affine[axis].begin());
    }
    const auto dot = [&](std::size_t i, std::size_t j) {
        return affine[i][0] * affine[j][0] + affine[i][1] * affine[j][1] + affine[i][2] * affine[j][2];
    };
    // The nearest orthogonal rows are M^(-1/2) A with M = A A^T, whose square root is (M + sqrt(det M)) / sqrt(tr M + 2 sqrt(det
    // M)).
    const double root = std::sqrt(std::max(dot(0, 0) * dot(1, 1) - dot(0, 1) * dot(0, 1), 0.0));
    if (!(root > 1e-8)) fail<ValueError>("[morphable fit] the landmarks are not finite or lie all on one line");
    const double norm = std::sqrt(dot(0, 0) + dot(1, 1) + 2.0 * root);
    const double s00 = (dot(0, 0) + root) / norm, s11 = (dot(1, 1) + root) / norm, s01 = dot(0, 1) / norm;
    const double scale = 0.5 * (s00 + s11);
    Vector3 right{};
    Vector3 down{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        right[axis] = (s11 * affine[0][axis] - s01 * affine[1][axis]) / root;
        down[axis] = (s00 * affine[1][axis] - s01 * affine[0][axis]) / root;
    }
    Matrix3 rotation{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t next = (axis + 1) % 3;
        const std::size_t last = (axis + 2) % 3;
        rotation[axis] = {right[axis], -down[axis], -(right[next] * down[last] - right[last] * down[next])};
    }
    const Vector3 angles = angles_from_rotation(rotation);
    return {angles[0],
            angles[1],
            angles[2],
            (affine[0][3] - intrinsics.center_x) / scale,
            (affine[1][3] - intrinsics.center_y) / scale,
            intrinsics.focal / scale};
}

}  // namespace stymo::morphable
