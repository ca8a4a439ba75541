#include "train/pose_overlay.h"

#include <array>
#include <opencv2/imgproc.hpp>

namespace stymo {

Tensor with_head_axes(const Tensor& photo, const Camera& camera, double pivot_depth) {
    constexpr double length = 0.8;
    Tensor result = photo;
    const auto side = static_cast<int>(photo.shape(0));
    cv::Mat canvas(side, side, CV_32FC3, result.mutable_values<float>().data());
    const auto pixel = [&](const Vector3& point) {
        const Vector3 seen = project(camera, point);
        return cv::Point(cvFloor(seen[0] * side), cvFloor(seen[1] * side));
    };
    const Vector3 origin{0, 0, pivot_depth};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        Vector3 tip = origin;
        tip[axis] += length;
        cv::Scalar color(0, 0, 0);
        color[static_cast<int>(axis)] = 1.0;
        cv::line(canvas, pixel(origin), pixel(tip), color, 1 + side / 100);
    }
    return result;
}

}  // namespace stymo
