#pragma once

#include <Eigen/Core>
#include <deque>
#include <functional>
#include <optional>

namespace stymo {

/// A function's value and its gradient at one point.
struct ValueAndGradient {
    double value = 0.0;
    Eigen::VectorXd gradient;
};
using Objective = std::function<ValueAndGradient(const Eigen::VectorXd&)>;

struct LbfgsOptions {
    std::size_t history =
        20;  ///< pairs of steps and changes of the gradient that the curvature is estimated from
    double first_step = 1.0;  ///< length of the first trial step while there is no such pair
    double decrease =
        1e-4;  ///< part of the decrease that the slope promises which a step must keep
    double slope_left = 0.9;  ///< part of the slope that may be left after a step
    int evaluations = 20;     ///< of one line search at most
};

/// A step and how it changed the gradient.
struct CurvaturePair {
    Eigen::VectorXd step;
    Eigen::VectorXd gradient_change;
};

/// H v for the estimate H of the inverse Hessian matrix from the pairs, the oldest first: BFGS's
/// updates of the last pair's (s y / y y) I, without a matrix (Nocedal 1980). v itself without a
/// pair.
[[nodiscard]] Eigen::VectorXd inverse_hessian_product(const std::deque<CurvaturePair>& pairs,
                                                      const Eigen::VectorXd& v);

/// Minimises a function by L-BFGS in float64. The line search brackets and bisects until a step
/// meets the weak Wolfe conditions, which suits functions with kinks, such as L1 losses, as well
/// (Lewis and Overton 2013). A point with a value or gradient that is not finite counts as too far.
class Lbfgs {
public:
    explicit Lbfgs(Eigen::VectorXd start, const LbfgsOptions& options = {})
        : options_(options), point_(std::move(start)) {}

    /// One iteration, with `most_evaluations` of the objective at most; the first one needs two.
    /// The point moves to a lower value, or stays where it is. False if nothing lower was found,
    /// downhill neither: a minimum, as far as rounding tells, or too few evaluations. Throws
    /// NumericError if value or gradient at the point itself are not finite, ShapeError for a
    /// gradient of another size.
    [[nodiscard]] bool step(const Objective& objective, int most_evaluations);
    /// The next iteration evaluates the present point anew, for it has another objective; the
    /// curvature stays.
    void objective_changed() { here_.reset(); }

    [[nodiscard]] const Eigen::VectorXd& point() const { return point_; }
    /// At the point; nothing before the first iteration and after `objective_changed`.
    [[nodiscard]] const std::optional<ValueAndGradient>& here() const { return here_; }

private:
    struct Place {
        Eigen::VectorXd point;
        ValueAndGradient at;
    };
    [[nodiscard]] std::optional<Place> search(const Objective& objective,
                                              const Eigen::VectorXd& direction, double first_part,
                                              int& evaluations_left) const;
    void move_to(Place place);

    LbfgsOptions options_;
    Eigen::VectorXd point_;
    std::optional<ValueAndGradient> here_;
    std::deque<CurvaturePair> pairs_;
};

}  // namespace stymo
