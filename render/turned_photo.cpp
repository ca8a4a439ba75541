#include "render/turned_photo.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/parallel.h"
#include "render/depth_map.h"

namespace stymo {

namespace {

/// Width of the rim, as a share of the image's side.
constexpr double rim = 0.03;
constexpr float on_head = 0.9F;

cv::Mat as_mat(const Tensor& image) {
    const auto side = static_cast<int>(image.shape(0));
    return {side, side, CV_MAKETYPE(CV_32F, static_cast<int>(image.shape(2))),
            const_cast<float*>(image.values<float>().data())};
}

/// The image point of the photo that shows what the view has at `image_point`; outside the image if
/// the photo does not show it.
Eigen::Vector2d point_in_photo(const SeenFace& photo, const SeenFace& view,
                               const Eigen::Vector2d& image_point, double tolerance) {
    const Eigen::Vector3d point = point_at(view.camera, view.depth, image_point);
    const Eigen::Vector3d projected = project(photo.camera, point);
    const Eigen::Vector2d photo_point = projected.head<2>();
    const double distance = (point - photo.camera.center).norm();
    const bool inside =
        projected[2] > 0.0 && photo_point.minCoeff() > 0.0 && photo_point.maxCoeff() < 1.0;
    if (inside && std::abs(depth_at(photo.depth, photo_point) - distance) < tolerance * distance)
        return photo_point;
    return {-1.0, -1.0};
}

/// Softens the border of the visible region: a rim in which the weight rises from 0 to 1.
void soften(cv::Mat& seen) {
    const int width = std::max(1, static_cast<int>(rim * seen.cols)) | 1;
    cv::blur(seen, seen, {width, width}, {-1, -1}, cv::BORDER_CONSTANT);
    seen = cv::max(2.0 * seen - 1.0, 0.0);
}

}  // namespace

TurnedPhoto turned_photo(const SeenFace& photo, const SeenFace& view, double tolerance) {
    const std::int64_t side = view.image.shape(0);
    TurnedPhoto turned{view.image, Tensor({side, side, 1})};
    cv::Mat image_points(static_cast<int>(side), static_cast<int>(side), CV_32FC2), colors, masks;
    const auto photo_side = static_cast<double>(photo.image.shape(0));
    parallel_for(side, 8, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t row = begin; row < end; ++row) {
            for (std::int64_t column = 0; column < side; ++column) {
                const Eigen::Vector2d image_point(
                    (static_cast<double>(column) + 0.5) / double(side),
                    (static_cast<double>(row) + 0.5) / double(side));
                const Eigen::Vector2d pixel =
                    point_in_photo(photo, view, image_point, tolerance) * photo_side -
                    Eigen::Vector2d(0.5, 0.5);
                image_points.at<cv::Vec2f>(static_cast<int>(row), static_cast<int>(column)) = {
                    static_cast<float>(pixel[0]), static_cast<float>(pixel[1])};
            }
        }
    });
    cv::remap(as_mat(photo.image), colors, image_points, cv::noArray(), cv::INTER_CUBIC,
              cv::BORDER_REPLICATE);
    cv::remap(as_mat(photo.mask), masks, image_points, cv::noArray(), cv::INTER_LINEAR);
    cv::Mat seen(static_cast<int>(side), static_cast<int>(side), CV_32F,
                 turned.seen.mutable_values<float>().data());
    const cv::Mat both = cv::min(masks, as_mat(view.mask));
    cv::Mat(both > on_head).convertTo(seen, CV_32F, 1.0 / 255.0);
    soften(seen);
    const auto image = turned.image.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const float share = turned.seen.values<float>()[static_cast<std::size_t>(i)];
        const auto* const color = colors.ptr<float>() + 3 * i;
        for (std::int64_t channel = 0; share > 0.0F && channel < 3; ++channel) {
            float& value = image[static_cast<std::size_t>(3 * i + channel)];
            value += share * (color[channel] - value);
        }
    }
    return turned;
}

}  // namespace stymo
