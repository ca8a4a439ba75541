#include "fit/photo/photo_overlay.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "render/rasterizer.h"

namespace stymo {
namespace {

cv::Mat canvas_of(Tensor& photo) {
    return {static_cast<int>(photo.shape(0)), static_cast<int>(photo.shape(1)), CV_32FC3, photo.mutable_values<float>().data()};
}

/// How directly each vertex faces the camera, as a grey.
Tensor relief(const Tensor& vertices, const MorphableHead& head, const Camera& camera) {
    const Tensor normals = vertex_normals(vertices, head.triangles);
    Tensor colors(vertices.shape());
    const auto normal = normals.values<float>();
    const auto color = colors.mutable_values<float>();
    for (std::size_t i = 0; i + 2 < color.size(); i += 3) {
        double facing = 0.0;
        for (std::size_t axis = 0; axis < 3; ++axis)
            facing -= camera.world_from_camera[axis][2] * static_cast<double>(normal[i + axis]);
        const auto grey = static_cast<float>(std::clamp(facing * facing * facing, 0.0, 1.0));
        color[i] = color[i + 1] = color[i + 2] = grey;
    }
    return colors;
}

/// Whether the face proper: hair, ears and the back of the head would hide the photo.
bool is_face(HeadPart part) {
    return part != HeadPart::hair && part != HeadPart::ears;
}

}  // namespace

Tensor with_head_axes(const Tensor& photo, const Camera& camera, double pivot_depth) {
    constexpr double length = 0.8;
    Tensor result = photo;
    const cv::Mat canvas = canvas_of(result);
    const auto side = static_cast<int>(photo.shape(0));
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

Tensor with_landmarks(const Tensor& photo, const Landmarks& landmarks) {
    Tensor result = photo;
    const cv::Mat canvas = canvas_of(result);
    for (const PicturePoint& point : landmarks)
        cv::circle(canvas, {cvFloor(point[0]), cvFloor(point[1])}, 1 + canvas.rows / 256, {0.1, 1.0, 0.1}, cv::FILLED);
    return result;
}

Tensor with_mask_outline(const Tensor& photo, const Tensor& mask) {
    Tensor result = photo;
    const cv::Mat canvas = canvas_of(result);
    cv::Mat head(canvas.rows, canvas.cols, CV_8U);
    std::ranges::transform(mask.values<float>(), head.begin<unsigned char>(),
                           [](float value) { return static_cast<unsigned char>(value > 0.5F ? 255 : 0); });
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(head, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    cv::drawContours(canvas, outlines, -1, {1.0, 0.9, 0.1}, 1 + canvas.rows / 256);
    return result;
}

Tensor with_mesh(const Tensor& photo, const MorphableHead& head, const Tensor& vertices, const Camera& camera) {
    std::vector<std::array<std::int32_t, 3>> face;
    std::ranges::copy_if(head.triangles, std::back_inserter(face), [&](const std::array<std::int32_t, 3>& triangle) {
        return std::ranges::all_of(triangle, [&](std::int32_t vertex) { return is_face(head.parts[static_cast<std::size_t>(vertex)]); });
    });
    const std::int64_t side = photo.shape(0);
    const RasterImage mesh = rasterize(vertices, relief(vertices, head, camera), face, camera, {side, side, 1});
    Tensor result = photo;
    constexpr float opacity = 0.55F;
    const auto color = mesh.color.values<float>();
    const auto coverage = mesh.coverage.values<float>();
    const auto values = result.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] += opacity * (color[i] - coverage[i / 3] * values[i]);
    return result;
}

}  // namespace stymo
