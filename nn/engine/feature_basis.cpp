#include "nn/engine/feature_basis.h"

#include <Eigen/Eigenvalues>

#include "core/kernels/matmul.h"
#include "core/tensor_eigen.h"

namespace stymo {
namespace {

/// Summed in double precision, because there may be many rows. 0 if all weights are 0.
Eigen::RowVectorXf weighted_mean(const Tensor& features, const Tensor& weights) {
    const auto rows = matrix_map<float>(features);
    const auto weight = weights.values<float>();
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(rows.cols());
    double total = 0.0;
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
        const auto share = static_cast<double>(weight[static_cast<std::size_t>(i)]);
        sum += share * rows.row(i).cast<double>();
        total += share;
    }
    if (total > 0.0) sum /= total;
    return sum.cast<float>();
}

}  // namespace

FeatureBasis principal_plane(const Tensor& features, const Tensor& weights,
                             std::int64_t dimension) {
    const std::int64_t rows = features.shape(0), channels = features.shape(1);
    const Eigen::RowVectorXf mean = weighted_mean(features, weights);
    Tensor deviations({1, rows, channels});
    mutable_matrix_map<float>(deviations) =
        (matrix_map<float>(features).rowwise() - mean).array().colwise() *
        matrix_map<float>(weights).transpose().array().sqrt().col(0);
    const Tensor product = kernels::matmul(deviations, deviations, {.transpose_a = true});
    const auto covariance = matrix_map<float>(product);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf> solver(covariance);
    // Eigen sorts by increasing eigenvalue.
    const Eigen::MatrixXf directions = solver.eigenvectors().rightCols(dimension);
    return {tensor_from(mean), tensor_from(directions.transpose())};
}

}  // namespace stymo
