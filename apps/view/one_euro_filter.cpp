#include "apps/view/one_euro_filter.h"

#include <numbers>

namespace stymo::view {

namespace {

double time_constant(double cutoff) {
    return 1.0 / (2.0 * std::numbers::pi * cutoff);
}

/// Weight of a new value after `interval` seconds.
double weight(double cutoff, double interval) {
    return interval / (interval + time_constant(cutoff));
}

}  // namespace

Eigen::Vector3d OneEuroFilter::operator()(const Eigen::Vector3d& measured, double seconds) {
    if (!state_) {
        state_ = {measured, measured, Eigen::Vector3d::Zero(), seconds};
        lag_ = time_constant(settings_.least_cutoff);
        return measured;
    }
    const double interval = seconds - state_->seconds;
    if (!(interval > 0.0)) return state_->point;
    const Eigen::Vector3d speed = (measured - state_->measured) / interval;
    state_->speed += weight(settings_.speed_cutoff, interval) * (speed - state_->speed);
    const double cutoff = settings_.least_cutoff + settings_.speed_factor * state_->speed.norm();
    state_->point += weight(cutoff, interval) * (measured - state_->point);
    state_->measured = measured;
    state_->seconds = seconds;
    lag_ = time_constant(cutoff);
    return state_->point;
}

}  // namespace stymo::view
