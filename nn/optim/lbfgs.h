#pragma once

#include <Eigen/Core>
#include <deque>
#include <functional>
#include <optional>

namespace stymo {

/// The value of a function and its gradient at one point.
struct ValueAndGradient {
    double value = 0.0;
    Eigen::VectorXd gradient;
};
using Objective = std::function<ValueAndGradient(const Eigen::VectorXd&)>;

struct LbfgsOptions {
    /// Number of pairs (step, change of the gradient) from which the curvature is estimated.
    std::size_t history = 20;
    double first_step = 1.0;  ///< length of the first trial step when there is no such pair
    /// c1 of the Wolfe conditions: a step must decrease the value by this part of what the slope
    /// predicts.
    double decrease = 1e-4;
    double slope_left =
        0.9;               ///< c2 of the weak Wolfe conditions: part of the slope that may remain
    int evaluations = 20;  ///< largest number in one line search
};

/// A step and the change of the gradient along it.
struct CurvaturePair {
    Eigen::VectorXd step;
    Eigen::VectorXd gradient_change;
};

/// H v, where H is the BFGS estimate of the inverse Hessian matrix from the pairs (oldest first),
/// computed without forming the matrix (Nocedal 1980). The initial matrix is (s y / y y) I of the
/// last pair. Without pairs the result is v.
[[nodiscard]] Eigen::VectorXd inverse_hessian_product(const std::deque<CurvaturePair>& pairs,
                                                      const Eigen::VectorXd& v);

/// Minimises a function by L-BFGS in float64. The line search brackets and bisects until a step
/// meets the weak Wolfe conditions, which also suits nonsmooth functions such as L1 losses (Lewis
/// and Overton 2013). A trial point whose value or gradient is not finite counts as too far.
class Lbfgs {
public:
    explicit Lbfgs(Eigen::VectorXd start, const LbfgsOptions& options = {})
        : options_(options), point_(std::move(start)) {}

    /// One iteration with at most `most_evaluations` evaluations of the objective; the first
    /// iteration needs two. The point moves to a lower value or stays. Returns false if no lower
    /// value was found, also not along the steepest descent: either the point is a minimum within
    /// rounding, or there were too few evaluations. Throws NumericError if the value or the
    /// gradient at the current point is not finite, ShapeError for a gradient of another size.
    [[nodiscard]] bool step(const Objective& objective, int most_evaluations);
    /// Call this if the objective changes: the next iteration evaluates the current point again.
    /// The curvature pairs are kept.
    void objective_changed() { current_.reset(); }

    [[nodiscard]] const Eigen::VectorXd& point() const { return point_; }
    /// Value and gradient at the point; nothing before the first iteration and after
    /// `objective_changed`.
    [[nodiscard]] const std::optional<ValueAndGradient>& current() const { return current_; }

private:
    struct Iterate {
        Eigen::VectorXd point;
        ValueAndGradient at;
    };
    [[nodiscard]] std::optional<Iterate> search(const Objective& objective,
                                                const Eigen::VectorXd& direction, double first_part,
                                                int& evaluations_left) const;
    void move_to(Iterate next);

    LbfgsOptions options_;
    Eigen::VectorXd point_;
    std::optional<ValueAndGradient> current_;
    std::deque<CurvaturePair> pairs_;
};

}  // namespace stymo
