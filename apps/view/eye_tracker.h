#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "fit/photo/face_detector.h"
#include "fit/video/one_euro_filter.h"

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
    OneEuroFilter<3> filter_;
};

}  // namespace stymo::view
