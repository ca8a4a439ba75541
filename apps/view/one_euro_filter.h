#pragma once

#include <Eigen/Core>
#include <optional>

namespace stymo::view {

/// The 1-euro filter (Casiez, Roussel, Vogel 2012) for noisy measurements of a point: a low-pass
/// filter whose cutoff rises with the speed, so that a point at rest does not jitter and a moving
/// point lags little.
class OneEuroFilter {
public:
    struct Settings {
        double least_cutoff = 1.0;  ///< cutoff in hertz at rest
        /// Increase of the cutoff in hertz for each unit of length per second.
        double speed_factor = 2.0;
        double speed_cutoff = 1.0;  ///< cutoff in hertz of the low-pass filter for the speed
    };

    OneEuroFilter() = default;
    explicit OneEuroFilter(const Settings& settings) : settings_(settings) {}

    /// The filtered point at a time in seconds, which must not decrease.
    Eigen::Vector3d operator()(const Eigen::Vector3d& measured, double seconds);
    /// Lag in seconds behind a point that moves steadily with the speed of the last measurement:
    /// the time constant, 1 / (2 pi cutoff).
    [[nodiscard]] double lag() const { return lag_; }

private:
    struct State {
        Eigen::Vector3d measured;
        Eigen::Vector3d point;  ///< filtered
        Eigen::Vector3d speed;
        double seconds;
    };
    Settings settings_;
    std::optional<State> state_;
    double lag_ = 0.0;
};

}  // namespace stymo::view
