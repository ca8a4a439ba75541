#include "render/morphable/face_surface.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/median.h"
#include "render/depth_map.h"
#include "render/rasterizer.h"

namespace stymo {

namespace {

Eigen::Vector3d vertex_at(const Tensor& vertices, std::int64_t vertex) {
    const float* values = vertices.values<float>().data() + 3 * vertex;
    return {values[0], values[1], values[2]};
}

Eigen::Vector3d middle_of(const MorphableHead& head, const Tensor& vertices, std::size_t first,
                          std::size_t count) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = first; i < first + count; ++i)
        sum += vertex_at(vertices, head.landmarks[i]);
    return sum / static_cast<double>(count);
}

/// The convex hull of the head's 68 points in the image, in units of its side.
std::vector<cv::Point2f> face_outline(const MorphableHead& head, const Tensor& vertices,
                                      const Camera& camera) {
    std::vector<cv::Point2f> points, hull;
    for (const std::int32_t vertex : head.landmarks) {
        const Eigen::Vector3d image_point = project(camera, vertex_at(vertices, vertex));
        points.emplace_back(static_cast<float>(image_point[0]), static_cast<float>(image_point[1]));
    }
    cv::convexHull(points, hull);
    return hull;
}

}  // namespace

FaceSurface face_surface(const MorphableHead& head, const Tensor& vertices, const Camera& camera,
                         std::int64_t side) {
    const RasterImage surface =
        rasterize(vertices, Tensor::zeros(vertices.shape()), head.triangles, camera,
                  {.width = side, .height = side, .samples_per_side = 1});
    const std::vector<cv::Point2f> outline = face_outline(head, vertices, camera);
    const auto extent = static_cast<double>(side);
    FaceSurface seen{Tensor::zeros({side, side, 1}), Tensor::zeros({side, side, 1})};
    const std::span<float> depths = seen.depth.mutable_values<float>();
    const std::span<float> face = seen.face.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Eigen::Vector2d image_point((static_cast<double>(i % side) + 0.5) / extent,
                                          (static_cast<double>(i / side) + 0.5) / extent);
        const cv::Point2f point(static_cast<float>(image_point[0]),
                                static_cast<float>(image_point[1]));
        const auto pixel = static_cast<std::size_t>(i);
        const double axial = surface.depth.values<float>()[pixel];
        if (!std::isfinite(axial) || cv::pointPolygonTest(outline, point, false) < 0.0) continue;
        depths[pixel] = static_cast<float>(axial / direction_at(camera.intrinsics, image_point)[2]);
        face[pixel] = 1.0F;
    }
    return seen;
}

std::vector<double> depth_differences(const Tensor& depths, const FaceSurface& surface) {
    if (!(depths.shape() == surface.depth.shape()))
        fail<ShapeError>("depth map ", depths.shape(), " and surface ", surface.depth.shape(),
                         " differ in shape");
    std::vector<double> differences;
    const std::span<const float> expected = surface.depth.values<float>();
    for (std::size_t i = 0; i < expected.size(); ++i)
        if (surface.face.values<float>()[i] > 0.0F)
            differences.push_back(double{depths.values<float>()[i]} - double{expected[i]});
    return differences;
}

Tensor moved_to_depth(const MorphableHead& head, const Tensor& vertices, const Camera& camera,
                      const Tensor& depths) {
    const std::vector<double> differences =
        depth_differences(depths, face_surface(head, vertices, camera, depths.shape(0)));
    if (differences.empty()) return vertices;
    const Eigen::Vector3d sight =
        (middle_of(head, vertices, 0, head.landmarks.size()) - camera.center).normalized();
    const Eigen::Vector3d shift = median(differences) * sight;
    Tensor moved = vertices;
    const std::span<float> values = moved.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] += static_cast<float>(shift[static_cast<Eigen::Index>(i % 3)]);
    return moved;
}

double eye_distance(const MorphableHead& head, const Tensor& vertices) {
    return (middle_of(head, vertices, 36, 6) - middle_of(head, vertices, 42, 6)).norm();
}

}  // namespace stymo
