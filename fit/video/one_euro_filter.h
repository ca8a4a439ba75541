#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <optional>

namespace stymo {

/// Parameters of `OneEuroFilter`; cutoffs in hertz.
struct OneEuroSettings {
    double least_cutoff = 1.0;  ///< at rest
    double speed_factor = 2.0;  ///< increase of the cutoff for each unit of length per second
    double speed_cutoff = 1.0;  ///< of the low-pass filter for the speed
    /// The speed is taken from the last filtered point (as in the publication) rather than from the
    /// last measurement. It is then too large for a point that moves steadily, which lags less.
    bool speed_from_filtered = false;
};

/// The 1-euro filter (G. Casiez, N. Roussel, D. Vogel, "1 Euro Filter", CHI 2012) for noisy
/// measurements of a point: a low-pass filter whose cutoff rises with the speed, so that a point at
/// rest does not jitter and a moving point lags little.
template <int dimension>
class OneEuroFilter {
public:
    using Point = Eigen::Matrix<double, dimension, 1>;

    explicit OneEuroFilter(const OneEuroSettings& settings = {}) : settings_(settings) {}

    /// The filtered point at a time in seconds. If time stands still the last point is returned.
    /// `unit` is the length in which the speed is counted.
    Point operator()(const Point& measured, double seconds, double unit = 1.0) {
        if (!state_) {
            state_ = {measured, measured, Point::Zero(), seconds};
            lag_ = time_constant(settings_.least_cutoff);
            return measured;
        }
        State& last = *state_;
        const double interval = seconds - last.seconds;
        if (!(interval > 0.0)) return last.point;
        const Point& from = settings_.speed_from_filtered ? last.point : last.measured;
        const Point speed = (measured - from) / (interval * unit);
        last.speed += weight(settings_.speed_cutoff, interval) * (speed - last.speed);
        const double cutoff = settings_.least_cutoff + settings_.speed_factor * last.speed.norm();
        last.point += weight(cutoff, interval) * (measured - last.point);
        last.measured = measured;
        last.seconds = seconds;
        lag_ = time_constant(cutoff);
        return last.point;
    }

    /// The next measurement is the first.
    void reset() { state_.reset(); }
    /// Lag in seconds behind a point that moves steadily with the speed of the last measurement:
    /// the time constant, 1 / (2 pi cutoff).
    [[nodiscard]] double lag() const { return lag_; }

private:
    struct State {
        Point measured;
        Point point;  ///< filtered
        Point speed;
        double seconds;
    };

    static double time_constant(double cutoff) { return 1.0 / (2.0 * std::numbers::pi * cutoff); }
    /// Of a new value after `interval` seconds.
    static double weight(double cutoff, double interval) {
        return interval / (interval + time_constant(cutoff));
    }

    OneEuroSettings settings_;
    std::optional<State> state_;
    double lag_ = 0.0;
};

}  // namespace stymo
