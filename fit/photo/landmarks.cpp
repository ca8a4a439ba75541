#include "fit/photo/landmarks.h"

namespace stymo {

Eigen::Vector2d mean_landmark(const Landmarks& landmarks, std::size_t first, std::size_t last) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::size_t i = first; i <= last; ++i) sum += landmarks[i];
    return sum / static_cast<double>(last - first + 1);
}

double inter_ocular_distance(const Landmarks& landmarks) {
    return (mean_landmark(landmarks, 42, 47) - mean_landmark(landmarks, 36, 41)).norm();
}

Landmarks scaled_landmarks(Landmarks landmarks, double factor) {
    for (Eigen::Vector2d& point : landmarks) point *= factor;
    return landmarks;
}

}  // namespace stymo
