#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

/// Nonlinear least squares for a few hundred unknowns. Not part of the public interface.
namespace stymo::morphable {

/// Quadratic model of a cost around a point: cost + gradient . d + d . matrix d / 2.
struct NormalEquations {
    explicit NormalEquations(Eigen::Index size)
        : matrix(Eigen::MatrixXd::Zero(size, size)), gradient(Eigen::VectorXd::Zero(size)) {}

    /// Adds weight / 2 (residual + row . d)^2, where row[i] belongs to unknown first + i.
    void add(std::span<const double> row, std::size_t first, double residual, double weight);

    Eigen::MatrixXd matrix;  ///< only the lower triangle is read
    Eigen::VectorXd gradient;
    double cost = 0.0;
};

/// The step d that minimises the model with `damping` times its diagonal added to the matrix; d[i]
/// = 0 where `fixed`. Nothing if the matrix is not positive definite.
[[nodiscard]] std::optional<Eigen::VectorXd> damped_step(const NormalEquations& equations,
                                                         double damping,
                                                         const std::vector<bool>& fixed);

struct LeastSquaresProblem {
    /// Updates the quantities that are constant within a step (weights, visibility), and returns
    /// the model at this point.
    std::function<NormalEquations(std::span<const double>)> linearized;
    /// The cost at another point with the same constants.
    std::function<double(std::span<const double>)> cost;
    std::vector<bool> fixed;         ///< unknowns that keep their values
    std::vector<bool> non_negative;  ///< unknowns that stay >= 0
};

/// Minimises by Levenberg-Marquardt from `start`. Unknowns at their bound stay there while the
/// gradient pushes outwards. A matrix that is not positive definite is damped more, as is a step
/// that does not improve. Throws NumericError if no damping below 1e4, from that of the step
/// before on, makes it positive definite.
[[nodiscard]] std::vector<double> minimized(const LeastSquaresProblem& problem,
                                            std::vector<double> start, int steps);

}  // namespace stymo::morphable
