#include "fit/morphable/least_squares.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace stymo::morphable {

namespace {

/// Solves matrix x = values for a positive definite matrix (lower triangle, overwritten) by Cholesky's factorisation.
void solve_in_place(std::vector<double>& matrix, std::vector<double>& values) {
    const std::size_t size = values.size();
    for (std::size_t i = 0; i < size; ++i) {
        double* const row = &matrix[i * size];
        for (std::size_t j = 0; j <= i; ++j) {
            const double* const other = &matrix[j * size];
            double sum = row[j];
            for (std::size_t k = 0; k < j; ++k) sum -= row[k] * other[k];
            if (j < i) {
                row[j] = sum / other[j];
            } else {
                if (!(sum > 0.0)) fail<NumericError>("[least squares] the normal equations are not positive definite");
                row[i] = std::sqrt(sum);
            }
        }
    }
    for (std::size_t i = 0; i < size; ++i) {
        for (std::size_t k = 0; k < i; ++k) values[i] -= matrix[i * size + k] * values[k];
        values[i] /= matrix[i * size + i];
    }
    for (std::size_t i = size; i-- > 0;) {
        values[i] /= matrix[i * size + i];
        for (std::size_t k = 0; k < i; ++k) values[k] -= matrix[i * size + k] * values[i];
    }
}

}  // namespace

void NormalEquations::add(std::span<const double> row, std::size_t first, double residual, double weight) {
    const std::size_t size = gradient.size();
    for (std::size_t i = 0; i < row.size(); ++i) {
        const double scaled = weight * row[i];
        gradient[first + i] += scaled * residual;
        double* const target = &matrix[(first + i) * size + first];
        for (std::size_t k = 0; k <= i; ++k) target[k] += scaled * row[k];
    }
    cost += 0.5 * weight * residual * residual;
}

std::vector<double> damped_step(const NormalEquations& equations, double damping, const std::vector<bool>& fixed) {
    const std::size_t size = equations.gradient.size();
    std::vector<std::size_t> free;
    for (std::size_t i = 0; i < size; ++i) {
        if (!fixed[i]) free.push_back(i);
    }
    std::vector<double> matrix(free.size() * free.size());
    std::vector<double> values(free.size());
    for (std::size_t i = 0; i < free.size(); ++i) {
        for (std::size_t k = 0; k <= i; ++k) matrix[i * free.size() + k] = equations.matrix[free[i] * size + free[k]];
        matrix[i * free.size() + i] *= 1.0 + damping;
        values[i] = -equations.gradient[free[i]];
    }
    solve_in_place(matrix, values);
    std::vector<double> step(size, 0.0);
    for (std::size_t i = 0; i < free.size(); ++i) step[free[i]] = values[i];
    return step;
}

std::vector<double> minimized(const LeastSquaresProblem& problem, std::vector<double> start, int steps) {
    std::vector<double> x = std::move(start);
    double damping = 1e-3;
    constexpr double most_damping = 1e4;
    for (int step = 0; step < steps; ++step) {
        const NormalEquations equations = problem.linearized(x);
        std::vector<bool> fixed = problem.fixed;
        for (std::size_t i = 0; i < x.size(); ++i) {
            if (problem.non_negative[i] && x[i] <= 0.0 && equations.gradient[i] >= 0.0) fixed[i] = true;
        }
        bool improved = false;
        while (!improved && damping < most_damping) {
            const std::vector<double> direction = damped_step(equations, damping, fixed);
            std::vector<double> candidate = x;
            for (std::size_t i = 0; i < x.size(); ++i) {
                candidate[i] += direction[i];
                if (problem.non_negative[i]) candidate[i] = std::max(candidate[i], 0.0);
            }
            improved = problem.cost(candidate) < equations.cost;
            damping = improved ? std::max(damping / 10.0, 1e-6) : damping * 10.0;
            if (improved) x = std::move(candidate);
        }
        if (!improved) break;
    }
    return x;
}

}  // namespace stymo::morphable
