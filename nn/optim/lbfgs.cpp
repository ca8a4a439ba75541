#include "nn/optim/lbfgs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <ranges>
#include <utility>

#include "core/error.h"

namespace stymo {

namespace {

double dot(std::span<const double> a, std::span<const double> b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

/// a + factor * b
std::vector<double> sum(std::span<const double> a, double factor, std::span<const double> b) {
    std::vector<double> result(a.begin(), a.end());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] += factor * b[i];
    return result;
}

bool finite(const ValueAndGradient& at) {
    return std::isfinite(at.value) && std::ranges::all_of(at.gradient, [](double slope) { return std::isfinite(slope); });
}

}  // namespace

std::vector<double> inverse_hessian_product(const std::deque<CurvaturePair>& pairs, std::span<const double> v) {
    std::vector<double> result(v.begin(), v.end());
    if (pairs.empty()) return result;
    std::vector<double> parts;
    for (const auto& [step, change] : pairs | std::views::reverse) {
        parts.push_back(dot(step, result) / dot(step, change));
        result = sum(result, -parts.back(), change);
    }
    const auto& [last_step, last_change] = pairs.back();
    const double scale = dot(last_step, last_change) / dot(last_change, last_change);
    for (double& number : result) number *= scale;
    for (const auto& [step, change] : pairs) {
        result = sum(result, parts.back() - dot(change, result) / dot(step, change), step);
        parts.pop_back();
    }
    return result;
}

std::optional<Lbfgs::Place> Lbfgs::search(const Objective& objective, const std::vector<double>& direction, double first_part,
                                          int& evaluations_left) const {
    const double slope = dot(here_->gradient, direction);
    std::optional<Place> lower;
    double near = 0.0, far = std::numeric_limits<double>::infinity();
    double part = first_part;
    const int last = std::max(0, evaluations_left - options_.evaluations);
    while (evaluations_left > last) {
        --evaluations_left;
        Place trial{sum(point_, part, direction), {}};
        // Steps that rounding swallows lead nowhere.
        if (trial.point == point_) break;
        trial.at = objective(trial.point);
        const bool low = finite(trial.at) && trial.at.value <= here_->value + options_.decrease * part * slope;
        if (!low) {
            far = part;
        } else {
            near = part;
            const bool flat = dot(trial.at.gradient, direction) >= options_.slope_left * slope;
            if (!lower || trial.at.value <= lower->at.value) lower = std::move(trial);
            if (flat) break;
        }
        part = std::isfinite(far) ? 0.5 * (near + far) : 2.0 * part;
    }
    return lower;
}

void Lbfgs::move_to(Place place) {
    CurvaturePair pair{sum(place.point, -1.0, point_), sum(place.at.gradient, -1.0, here_->gradient)};
    point_ = std::move(place.point);
    here_ = std::move(place.at);
    // Else the estimate would lose its positive curvature: the search ended before the slope was small enough.
    constexpr double least = 1e-12;
    if (dot(pair.step, pair.gradient_change) <= least * dot(pair.gradient_change, pair.gradient_change)) return;
    pairs_.push_back(std::move(pair));
    if (pairs_.size() > options_.history) pairs_.pop_front();
}

bool Lbfgs::step(const Objective& objective, int most_evaluations) {
    if (most_evaluations < 1) return false;
    if (!here_) {
        --most_evaluations;
        here_ = objective(point_);
        if (here_->gradient.size() != point_.size())
            fail<ShapeError>("L-BFGS: a gradient of ", here_->gradient.size(), " numbers at a point of ", point_.size());
        if (!finite(*here_)) fail<NumericError>("L-BFGS: the value or the gradient is not finite where it stands");
    }
    const double length = std::sqrt(dot(here_->gradient, here_->gradient));
    if (length == 0.0) return false;
    if (!pairs_.empty()) {
        std::vector<double> direction = inverse_hessian_product(pairs_, here_->gradient);
        for (double& number : direction) number = -number;
        if (std::optional<Place> place = search(objective, direction, 1.0, most_evaluations)) {
            move_to(std::move(*place));
            return true;
        }
        // A curvature that misleads is forgotten.
        pairs_.clear();
    }
    std::vector<double> downhill = here_->gradient;
    for (double& number : downhill) number = -number;
    std::optional<Place> place = search(objective, downhill, options_.first_step / length, most_evaluations);
    if (place) move_to(std::move(*place));
    return place.has_value();
}

}  // namespace stymo
