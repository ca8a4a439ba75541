#include "nn/optim/lbfgs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/error.h"

namespace stymo {

namespace {

bool finite(const ValueAndGradient& at) {
    return std::isfinite(at.value) && at.gradient.allFinite();
}

}  // namespace

Eigen::VectorXd inverse_hessian_product(const std::deque<CurvaturePair>& pairs,
                                        const Eigen::VectorXd& v) {
    Eigen::VectorXd result = v;
    if (pairs.empty()) return result;
    std::vector<double> parts;
    for (auto pair = pairs.rbegin(); pair != pairs.rend(); ++pair) {
        const auto& [step, change] = *pair;
        parts.push_back(step.dot(result) / step.dot(change));
        result -= parts.back() * change;
    }
    const auto& [last_step, last_change] = pairs.back();
    result *= last_step.dot(last_change) / last_change.squaredNorm();
    for (const auto& [step, change] : pairs) {
        result += (parts.back() - change.dot(result) / step.dot(change)) * step;
        parts.pop_back();
    }
    return result;
}

std::optional<Lbfgs::Iterate> Lbfgs::search(const Objective& objective,
                                            const Eigen::VectorXd& direction, double first_part,
                                            int& evaluations_left) const {
    const double slope = current_->gradient.dot(direction);
    // The estimate of the curvature is positive definite but for rounding. Along a direction that
    // does not descend, the condition below would accept a higher value.
    if (!std::isfinite(slope) || slope >= 0.0) return std::nullopt;
    std::optional<Iterate> lower;
    double near = 0.0, far = std::numeric_limits<double>::infinity();
    double part = first_part;
    const int last = std::max(0, evaluations_left - options_.evaluations);
    while (evaluations_left > last) {
        --evaluations_left;
        Iterate trial{point_ + part * direction, {}};
        // The step is too small to change the point.
        if (trial.point == point_) break;
        trial.at = objective(trial.point);
        // The first comparison counts where the predicted decrease is below the rounding of the
        // value.
        const bool low = finite(trial.at) && trial.at.value < current_->value &&
                         trial.at.value <= current_->value + options_.decrease * part * slope;
        if (!low) {
            far = part;
        } else {
            near = part;
            const bool flat = trial.at.gradient.dot(direction) >= options_.slope_left * slope;
            if (!lower || trial.at.value <= lower->at.value) lower = std::move(trial);
            if (flat) break;
        }
        part = std::isfinite(far) ? 0.5 * (near + far) : 2.0 * part;
    }
    return lower;
}

void Lbfgs::move_to(Iterate next) {
    CurvaturePair pair{next.point - point_, next.at.gradient - current_->gradient};
    point_ = std::move(next.point);
    current_ = std::move(next.at);
    // Without positive curvature the estimate would not stay positive definite. This happens if the
    // search ended before the slope was small enough.
    constexpr double least = 1e-12;
    if (pair.step.dot(pair.gradient_change) <= least * pair.gradient_change.squaredNorm()) return;
    pairs_.push_back(std::move(pair));
    if (pairs_.size() > options_.history) pairs_.pop_front();
}

bool Lbfgs::step(const Objective& objective, int most_evaluations) {
    if (most_evaluations < 1) return false;
    if (!current_) {
        --most_evaluations;
        current_ = objective(point_);
        if (current_->gradient.size() != point_.size())
            fail<ShapeError>("L-BFGS: a gradient of ", current_->gradient.size(),
                             " numbers at a point of ", point_.size());
        if (!finite(*current_))
            fail<NumericError>("L-BFGS: the value or the gradient is not finite where it stands");
    }
    const double length = current_->gradient.norm();
    if (length == 0.0) return false;
    if (!pairs_.empty()) {
        const Eigen::VectorXd direction = -inverse_hessian_product(pairs_, current_->gradient);
        if (std::optional<Iterate> next = search(objective, direction, 1.0, most_evaluations)) {
            move_to(std::move(*next));
            return true;
        }
        // The curvature estimate gave no descent, so it is discarded.
        pairs_.clear();
    }
    std::optional<Iterate> next =
        search(objective, -current_->gradient, options_.first_step / length, most_evaluations);
    if (next) move_to(std::move(*next));
    return next.has_value();
}

}  // namespace stymo
