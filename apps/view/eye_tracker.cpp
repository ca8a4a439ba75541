#include "apps/view/eye_tracker.h"

#include <cmath>

namespace stymo::view {

Eigen::Vector3d eye_point(const Landmarks& landmarks, double width, double height,
                          const EyeCamera& camera) {
    const Eigen::Vector2d left = mean_landmark(landmarks, 36, 41),
                          right = mean_landmark(landmarks, 42, 47);
    const double focal = 0.5 * width / std::tan(0.5 * camera.field_of_view);
    const double depth = pupil_distance * focal / (right - left).norm();
    const Eigen::Vector2d middle = 0.5 * (left + right);
    // The image's right is the viewer's left.
    return camera.position + Eigen::Vector3d(-(middle[0] - 0.5 * width) * depth / focal,
                                             -(middle[1] - 0.5 * height) * depth / focal, depth);
}

EyeTracker::EyeTracker(std::shared_ptr<const FaceDetector> detector)
    : detector_(std::move(detector)) {}

std::optional<EyeTracker::Sight> EyeTracker::see(const Tensor& image, const EyeCamera& camera,
                                                 double seconds) {
    const std::vector<DetectedFace> faces = detector_->find(image, FaceSearch::quick);
    if (faces.empty()) return std::nullopt;
    const Eigen::Vector3d measured =
        eye_point(faces.front().landmarks, static_cast<double>(image.shape(1)),
                  static_cast<double>(image.shape(0)), camera);
    if (!measured.allFinite()) return std::nullopt;
    const Eigen::Vector3d filtered = filter_(measured, seconds);
    return Sight{measured, filtered, filter_.lag()};
}

}  // namespace stymo::view
