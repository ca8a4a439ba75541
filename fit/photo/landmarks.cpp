#include "fit/photo/landmarks.h"

#include <span>

#include "render/morphable/builtin_head.h"

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

Landmarks mean_face_landmarks(const Camera& camera, std::int64_t side) {
    const MorphableHead& head = builtin_head();
    const std::span<const float> mean = head.mean.values<float>();
    Landmarks landmarks;
    for (std::size_t k = 0; k < landmarks.size(); ++k) {
        const auto first = static_cast<std::size_t>(3 * head.landmarks[k]);
        const Eigen::Vector3d vertex(mean[first], mean[first + 1], mean[first + 2]);
        landmarks[k] = static_cast<double>(side) * project(camera, vertex).head<2>();
    }
    return landmarks;
}

}  // namespace stymo
