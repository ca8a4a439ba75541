#include "fit/morphable/arkit_coefficients.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace stymo {

namespace {

using Rows =
    Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

Rows rows_of(const Tensor& basis) {
    return {basis.values<float>().data(), basis.shape(0), basis.shape(1) * basis.shape(2)};
}

template <class T>
Eigen::VectorXd vector_of(std::span<const T> values, Eigen::Index size) {
    if (std::ssize(values) != size)
        fail<ShapeError>("[ARKit] needs ", size, " numbers, got ", values.size());
    return Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(values.data(), size)
        .template cast<double>();
}

}  // namespace

Eigen::VectorXd non_negative_solution(const Eigen::MatrixXd& gram, const Eigen::VectorXd& moment,
                                      const std::vector<bool>& free) {
    const Eigen::Index size = moment.size();
    // Directions that hardly move anything would get huge values.
    const Eigen::MatrixXd damped =
        gram + 1e-9 * gram.diagonal().maxCoeff() * Eigen::MatrixXd::Identity(size, size);
    const double tolerance = 1e-10 * moment.cwiseAbs().maxCoeff();
    std::vector<bool> passive(free.size());
    for (Eigen::Index i = 0; i < size; ++i)
        passive[std::size_t(i)] = free[std::size_t(i)] && gram(i, i) > 0.0;
    Eigen::VectorXd x = Eigen::VectorXd::Zero(size);
    // Each round adds one unknown. The bound is never reached but by rounding.
    for (Eigen::Index round = 0; round < 10 * size; ++round) {
        for (bool inside = false; !inside;) {
            std::vector<Eigen::Index> set;
            for (Eigen::Index i = 0; i < size; ++i)
                if (passive[std::size_t(i)]) set.push_back(i);
            if (set.empty()) break;
            const Eigen::VectorXd solved =
                Eigen::MatrixXd(damped(set, set)).ldlt().solve(Eigen::VectorXd(moment(set)));
            double step = 1.0;
            for (std::size_t k = 0; k < set.size(); ++k) {
                const double from = x[set[k]], to = solved[Eigen::Index(k)];
                if (!free[std::size_t(set[k])] && to < 0.0)
                    step = std::min(step, from / std::max(from - to, 1e-300));
            }
            inside = step >= 1.0;
            for (std::size_t k = 0; k < set.size(); ++k) {
                double& value = x[set[k]];
                value += step * (solved[Eigen::Index(k)] - value);
                if (inside || free[std::size_t(set[k])] || value > 1e-14) continue;
                value = 0.0;
                passive[std::size_t(set[k])] = false;
            }
        }
        const Eigen::VectorXd slope = moment - damped * x;
        Eigen::Index best = -1;
        for (Eigen::Index i = 0; i < size; ++i)
            if (!passive[std::size_t(i)] && gram(i, i) > 0.0 && slope[i] > tolerance &&
                (best < 0 || slope[i] > slope[best]))
                best = i;
        if (best < 0) break;
        passive[std::size_t(best)] = true;
    }
    return x;
}

ArkitConversion::ArkitConversion(const MorphableHead& head)
    : shapes_(arkit_shapes(head)), vertices_(static_cast<double>(head.vertex_count())) {
    const Eigen::MatrixXd expressions = rows_of(head.expression).cast<double>();
    const Eigen::MatrixXd shapes = rows_of(shapes_.displacement).cast<double>();
    expressions_ = expressions * expressions.transpose();
    both_ = shapes * expressions.transpose();
    arkit_ = shapes * shapes.transpose();
    for (const bool one_sided : head.one_sided) two_sided_.push_back(!one_sided);
}

std::vector<double> ArkitConversion::coefficients(std::span<const float> code) const {
    const Eigen::VectorXd x =
        non_negative_solution(arkit_, both_ * vector_of(code, expressions_.rows()),
                              std::vector<bool>(arkit_names.size(), false));
    return {x.begin(), x.end()};
}

std::vector<float> ArkitConversion::code(std::span<const double> coefficients) const {
    const Eigen::VectorXd x = non_negative_solution(
        expressions_, both_.transpose() * vector_of(coefficients, arkit_.rows()), two_sided_);
    return {x.begin(), x.end()};
}

double ArkitConversion::size(std::span<const float> code) const {
    const Eigen::VectorXd x = vector_of(code, expressions_.rows());
    return std::sqrt(std::max(x.dot(expressions_ * x), 0.0) / vertices_);
}

double ArkitConversion::difference(std::span<const float> code,
                                   std::span<const double> coefficients) const {
    const Eigen::VectorXd x = vector_of(code, expressions_.rows());
    const Eigen::VectorXd y = vector_of(coefficients, arkit_.rows());
    const double squares = x.dot(expressions_ * x) - 2.0 * y.dot(both_ * x) + y.dot(arkit_ * y);
    return std::sqrt(std::max(squares, 0.0) / vertices_);
}

}  // namespace stymo
