#include "fit/photo/preparation_overlay.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/io/image.h"
#include "core/ops/elementwise.h"
#include "render/rasterizer.h"
#include "render/spherical_harmonics.h"

namespace stymo {

Tensor with_fitted_head(const Tensor& photo, const MorphableHead& head, const MorphableFit& fit,
                        const Intrinsics& intrinsics) {
    constexpr float opacity = 0.6F;
    const Camera camera = camera_from_pose(fit.pose, intrinsics);
    const Tensor vertices = head_vertices(head, fit.identity, fit.expression);
    const Tensor colors =
        shaded_colors(head_albedo(head, fit.texture), vertex_normals(vertices, head.triangles),
                      fit.light, camera);
    const RasterImage raster =
        rasterize(vertices, colors, head.triangles, camera, {photo.shape(1), photo.shape(0), 2});
    Tensor result = photo;
    const auto target = result.mutable_values<float>();
    const auto drawn = raster.color.values<float>();
    const auto coverage = raster.coverage.values<float>();
    for (std::size_t i = 0; i < target.size(); ++i)
        target[i] = std::clamp(target[i] * (1.0F - opacity * coverage[i / 3]) + opacity * drawn[i],
                               0.0F, 1.0F);
    return result;
}

namespace {

cv::Mat canvas_of(Tensor& photo) {
    return {static_cast<int>(photo.shape(0)), static_cast<int>(photo.shape(1)), CV_32FC3,
            photo.mutable_values<float>().data()};
}

}  // namespace

Tensor with_head_axes(const Tensor& photo, const Camera& camera, double pivot_depth) {
    constexpr double length = 0.8;
    Tensor result = photo;
    const cv::Mat canvas = canvas_of(result);
    const auto side = static_cast<int>(photo.shape(0));
    const auto pixel = [&](const Eigen::Vector3d& point) {
        const Eigen::Vector3d seen = project(camera, point);
        return cv::Point(cvFloor(seen[0] * side), cvFloor(seen[1] * side));
    };
    const Eigen::Vector3d origin{0, 0, pivot_depth};
    for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3d tip = origin;
        tip[axis] += length;
        cv::Scalar color(0, 0, 0);
        color[axis] = 1.0;
        cv::line(canvas, pixel(origin), pixel(tip), color, 1 + side / 100, cv::LINE_AA);
        cv::putText(canvas, std::string(1, "xyz"[axis]), pixel(tip), cv::FONT_HERSHEY_SIMPLEX,
                    side / 400.0, color, 1 + side / 300, cv::LINE_AA);
    }
    return result;
}

Tensor with_landmarks(const Tensor& photo, const Landmarks& landmarks) {
    Tensor result = photo;
    const cv::Mat canvas = canvas_of(result);
    for (const Eigen::Vector2d& point : landmarks)
        cv::circle(canvas, {cvFloor(point[0]), cvFloor(point[1])}, 1 + canvas.rows / 256,
                   {0.1, 1.0, 0.1}, cv::FILLED);
    return result;
}

Tensor with_mask_outline(const Tensor& photo, const Tensor& mask) {
    Tensor result = photo;
    const cv::Mat canvas = canvas_of(result);
    cv::Mat head(canvas.rows, canvas.cols, CV_8U);
    std::ranges::transform(mask.values<float>(), head.begin<unsigned char>(), [](float value) {
        return static_cast<unsigned char>(value > 0.5F ? 255 : 0);
    });
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(head, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    cv::drawContours(canvas, outlines, -1, {1.0, 0.9, 0.1}, 1 + canvas.rows / 256);
    return result;
}

Tensor preparation_overlay(const PhotoWithFindings& photo, const MorphableHead& head,
                           const Intrinsics& intrinsics, std::int64_t side) {
    const int pixels = static_cast<int>(side);
    const auto resized = [&](const Tensor& image) {
        return clamp(resize_image(image, pixels, pixels), 0.0, 1.0).value();
    };
    const double scale = static_cast<double>(side) / static_cast<double>(photo.image.shape(0));
    constexpr double pivot_depth = 0.9;
    Tensor image = with_fitted_head(resized(photo.image), head, photo.fit, intrinsics);
    image = with_mask_outline(image, resized(photo.mask));
    image = with_landmarks(image, scaled_landmarks(photo.landmarks, scale));
    return with_head_axes(image, camera_from_pose(photo.fit.pose, intrinsics), pivot_depth);
}

}  // namespace stymo
