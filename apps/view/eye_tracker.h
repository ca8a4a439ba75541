#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "apps/view/one_euro_filter.h"
#include "fit/photo/face_detector.h"

namespace stymo::view {

/// How the viewer's camera sees. Lengths in metres.
struct EyeCamera {
    double field_of_view = 1.05;  ///< horizontal, in radians
    /// The camera's place from the middle of the picture on the screen: x to the viewer's right, y
    /// up, z towards the viewer. On top of a laptop's screen: about (0, 0.15, 0).
    Eigen::Vector3d place{0.0, 0.15, 0.0};
};

/// The mean distance between the pupils of adults (Dodgson 2004), which tells how far a head is.
inline constexpr double pupil_distance = 0.063;

/// The point between the eyes of a face in the camera's image of this many pixels, in metres from
/// the middle of the picture on the screen, in the axes of `EyeCamera::place`. The camera looks
/// straight ahead, and its image is not mirrored.
[[nodiscard]] Eigen::Vector3d eye_point(const Landmarks& landmarks, double width, double height,
                                        const EyeCamera& camera);

/// Follows the head of one viewer from image to image. Keeps no image.
class EyeTracker {
public:
    struct Sight {
        Eigen::Vector3d measured;  ///< metres, as `eye_point`
        Eigen::Vector3d filtered;
        double lag = 0.0;  ///< seconds by which the filter is behind a steady movement
    };

    explicit EyeTracker(std::shared_ptr<const FaceDetector> detector);

    /// The eyes in an image (height, width, 3) that was taken at this time in seconds; nothing
    /// where there is no face.
    [[nodiscard]] std::optional<Sight> see(const Tensor& image, const EyeCamera& camera,
                                           double seconds);

private:
    std::shared_ptr<const FaceDetector> detector_;
    OneEuroFilter filter_;
};

}  // namespace stymo::view
