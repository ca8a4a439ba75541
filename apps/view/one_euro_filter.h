#pragma once

#include <Eigen/Core>
#include <optional>

namespace stymo::view {

/// The 1-euro filter (Casiez, Roussel, Vogel 2012) of a point that is measured with noise: a
/// low-pass whose cutoff rises with the speed, so that a point at rest does not tremble and one
/// that moves does not lag.
class OneEuroFilter {
public:
    struct Settings {
        double least_cutoff = 1.0;  ///< hertz, at rest
        double speed_factor = 2.0;  ///< hertz for each unit of length and second
        double speed_cutoff = 1.0;  ///< hertz, of the speed itself
    };

    OneEuroFilter() = default;
    explicit OneEuroFilter(const Settings& settings) : settings_(settings) {}

    /// The filtered point at a time in seconds, which must not decrease.
    Eigen::Vector3d operator()(const Eigen::Vector3d& measured, double seconds);
    /// By how many seconds the filtered point lags behind one that moves steadily as at the last
    /// measurement: the time constant, 1 / (2 pi cutoff).
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
