#include "fit/morphable/least_squares.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "core/error.h"

namespace stymo::morphable {

void NormalEquations::add(std::span<const double> row, std::size_t first, double residual,
                          double weight) {
    const Eigen::Map<const Eigen::VectorXd> slopes(row.data(), std::ssize(row));
    const auto begin = static_cast<Eigen::Index>(first);
    matrix.block(begin, begin, slopes.size(), slopes.size())
        .selfadjointView<Eigen::Lower>()
        .rankUpdate(slopes, weight);
    gradient.segment(begin, slopes.size()) += weight * residual * slopes;
    cost += 0.5 * weight * residual * residual;
}

std::optional<Eigen::VectorXd> damped_step(const NormalEquations& equations, double damping,
                                           const std::vector<bool>& fixed) {
    std::vector<Eigen::Index> free;
    for (std::size_t i = 0; i < fixed.size(); ++i) {
        if (!fixed[i]) free.push_back(static_cast<Eigen::Index>(i));
    }
    Eigen::MatrixXd matrix = equations.matrix(free, free);
    matrix.diagonal() *= 1.0 + damping;
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(matrix);
    Eigen::VectorXd step = Eigen::VectorXd::Zero(equations.gradient.size());
    step(free) = -factor.solve(equations.gradient(free).eval());
    if (factor.info() != Eigen::Success || !step.allFinite()) return std::nullopt;
    return step;
}

std::vector<double> minimized(const LeastSquaresProblem& problem, std::vector<double> start,
                              int steps) {
    std::vector<double> x = std::move(start);
    double damping = 1e-3;
    constexpr double most_damping = 1e4;
    for (int step = 0; step < steps; ++step) {
        const NormalEquations equations = problem.linearized(x);
        std::vector<bool> fixed = problem.fixed;
        for (std::size_t i = 0; i < x.size(); ++i) {
            fixed[i] = fixed[i] || (problem.non_negative[i] && x[i] <= 0.0 &&
                                    equations.gradient[static_cast<Eigen::Index>(i)] >= 0.0);
        }
        bool improved = false, factorised = false;
        while (!improved && damping < most_damping) {
            if (const auto direction = damped_step(equations, damping, fixed)) {
                factorised = true;
                std::vector<double> candidate = x;
                for (std::size_t i = 0; i < x.size(); ++i) {
                    candidate[i] += (*direction)[static_cast<Eigen::Index>(i)];
                    if (problem.non_negative[i]) candidate[i] = std::max(candidate[i], 0.0);
                }
                improved = problem.cost(candidate) < equations.cost;
                if (improved) x = std::move(candidate);
            }
            damping = improved ? std::max(damping / 10.0, 1e-6) : damping * 10.0;
        }
        if (!factorised)
            fail<NumericError>("[least squares] the normal equations are not positive definite");
        if (!improved) break;
    }
    return x;
}

}  // namespace stymo::morphable
