#include "apps/view/eye_tracker.h"

#include <cmath>
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
