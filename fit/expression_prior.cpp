#include "fit/expression_prior.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "core/ops/shape_ops.h"
#include "core/tensor_eigen.h"

namespace stymo {

Tensor expression_directions(const Model& model) {
    // Of few faces, identity seems to say everything about the expression.
    if (!model.code_statistics() || model.code_statistics()->faces() < 2 * code_size) return {};
    // The factor is lower triangular, and its groups begin with identity and expression.
    constexpr std::int64_t begin = code_sizes[0], end = begin + code_sizes[1];
    const Variable rows = slice(model.code_statistics()->factor(), 0, begin, end);
    return transpose(slice(rows, 1, begin, end)).value();
}

PlausibleChanges::PlausibleChanges(const Model& model, const MorphableHead& head)
    : directions_(expression_directions(model)) {
    if (!directions_.defined()) return;
    constexpr double half_millimetre = 0.005;
    const Tensor& basis = head.expression;
    const Tensor rows = basis.reshaped({basis.shape(0), basis.shape(1) * basis.shape(2)});
    const Eigen::MatrixXd moved = matrix_map<float>(rows).cast<double>();
    const Eigen::MatrixXd c = matrix_map<float>(directions_).cast<double>();
    const Eigen::MatrixXd seen = moved * (c * moved).transpose();
    Eigen::MatrixXd normal = c * seen;
    normal.diagonal().array() +=
        static_cast<double>(head.vertex_count()) * half_millimetre * half_millimetre;
    units_ = normal.ldlt().solve(seen.transpose()).transpose();
    distances_ = moved * moved.transpose();
}

Tensor PlausibleChanges::operator()(const Tensor& change) const {
    if (!directions_.defined()) return change;
    const Eigen::RowVectorXd wanted = matrix_map<float>(change).cast<double>();
    const double squared = wanted * distances_ * wanted.transpose();
    if (!(squared > 0.0)) return Tensor::zeros(change.shape());
    const Eigen::MatrixXd c = matrix_map<float>(directions_).cast<double>();
    const Eigen::RowVectorXd u = wanted * units_;
    const double shown = u * c * distances_ * wanted.transpose();
    const double gain = squared / std::hypot(shown, squared / largest_gain);
    const double length = gain * u.norm();
    const double bound =
        length > 0.0 ? most_unusual * std::tanh(length / most_unusual) / length : 1.0;
    return tensor_from(Eigen::MatrixXd(gain * bound * u * c)).to(DType::float32);
}

}  // namespace stymo
