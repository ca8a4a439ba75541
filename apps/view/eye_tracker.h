#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "fit/photo/face_detector.h"

namespace stymo::view {

/// The viewer's camera. Lengths are in metres.
struct EyeCamera {
    double field_of_view = 1.05;  ///< horizontal, in radians
    /// Position of the camera relative to the centre of the picture on the screen: x to the
    /// viewer's right, y up, z towards the viewer. About (0, 0.15, 0) on top of a laptop's screen.
    Eigen::Vector3d position{0.0, 0.15, 0.0};
};

/// The mean distance between the pupils of adults (Dodgson 2004), from which the distance of a head
/// is computed.
inline constexpr double pupil_distance = 0.063;

/// The point between the eyes of a face, in metres, in the axes and with the origin of
/// `EyeCamera::position`. `landmarks` are in pixels of the camera's image (width x height), which
/// must not be mirrored. The camera looks straight ahead.
[[nodiscard]] Eigen::Vector3d eye_point(const Landmarks& landmarks, double width, double height,
                                        const EyeCamera& camera);

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

/// Tracks the head of one viewer over consecutive images. It stores no image.
class EyeTracker {
public:
    struct Sight {
        Eigen::Vector3d measured;  ///< in metres, as in `eye_point`
        Eigen::Vector3d filtered;
        double lag = 0.0;  ///< OneEuroFilter::lag in seconds
    };

    explicit EyeTracker(std::shared_ptr<const FaceDetector> detector);

    /// The eyes in an image (height, width, 3) taken at the time `seconds`; nothing if no face is
    /// found.
    [[nodiscard]] std::optional<Sight> see(const Tensor& image, const EyeCamera& camera,
                                           double seconds);

private:
    std::shared_ptr<const FaceDetector> detector_;
    OneEuroFilter filter_;
};

}  // namespace stymo::view
