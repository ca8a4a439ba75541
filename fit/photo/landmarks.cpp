#include "fit/photo/landmarks.h"

#include <cmath>

namespace stymo {

PicturePoint mean_landmark(const Landmarks& landmarks, std::size_t first, std::size_t last) {
    PicturePoint sum{};
    for (std::size_t i = first; i <= last; ++i) {
        sum[0] += landmarks[i][0];
        sum[1] += landmarks[i][1];
    }
    const auto count = static_cast<double>(last - first + 1);
    return {sum[0] / count, sum[1] / count};
}

double inter_ocular_distance(const Landmarks& landmarks) {
    const PicturePoint left = mean_landmark(landmarks, 36, 41);
    const PicturePoint right = mean_landmark(landmarks, 42, 47);
    return std::hypot(right[0] - left[0], right[1] - left[1]);
}

Landmarks scaled_landmarks(Landmarks landmarks, double factor) {
    for (PicturePoint& point : landmarks) point = {point[0] * factor, point[1] * factor};
    return landmarks;
}

}  // namespace stymo
