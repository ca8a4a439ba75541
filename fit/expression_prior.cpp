#include "fit/expression_prior.h"

#include <Eigen/Cholesky>

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

Tensor plausible_changes(const Model& model, const MorphableHead& head) {
    const Tensor directions = expression_directions(model);
    if (!directions.defined()) return {};
    constexpr double half_millimetre = 0.005;
    const Tensor& basis = head.expression;
    const Tensor rows = basis.reshaped({basis.shape(0), basis.shape(1) * basis.shape(2)});
    const Eigen::MatrixXd moved = matrix_map<float>(rows).cast<double>();
    const Eigen::MatrixXd c = matrix_map<float>(directions).cast<double>();
    const Eigen::MatrixXd seen = moved * (c * moved).transpose();
    Eigen::MatrixXd normal = c * seen;
    normal.diagonal().array() +=
        static_cast<double>(head.vertex_count()) * half_millimetre * half_millimetre;
    const Eigen::MatrixXd map = seen * normal.ldlt().solve(c);
    return tensor_from(map).to(DType::float32);
}

}  // namespace stymo
