// A head laid onto the surface of another one, whose depth maps the rasteriser draws.
#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/median.h"
#include "core/tensor_eigen.h"
#include "fit/laid_head.h"
#include "render/depth_map.h"
#include "render/morphable/builtin_head.h"
#include "render/rasterizer.h"

namespace laid_head_tests {

namespace {

using stymo::Tensor;

/// Distances along the rays, of which the rasteriser has the component along the optical axis.
Tensor depth_of(const Tensor& vertices, const stymo::Camera& camera, std::int64_t side) {
    Tensor depth = stymo::rasterize(vertices, vertices, stymo::builtin_head().triangles, camera,
                                    {side, side, 1})
                       .depth;
    const auto values = depth.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto extent = static_cast<double>(side);
        const Eigen::Vector2d place((double(i % std::size_t(side)) + 0.5) / extent,
                                    (double(i / std::size_t(side)) + 0.5) / extent);
        values[i] /= static_cast<float>(stymo::direction_at(camera.intrinsics, place)[2]);
    }
    return depth;
}

std::vector<stymo::SeenFace> views_of(const Tensor& vertices) {
    std::vector<stymo::SeenFace> views;
    for (const double yaw : {0.0, -0.4, 0.4, -0.2, 0.2}) {
        const stymo::Camera camera =
            stymo::camera_from_pose(stymo::orbit_pose(yaw, 0.0, 0.0, 5.3), {});
        views.push_back({camera, {}, {}, depth_of(vertices, camera, 128)});
    }
    return views;
}

/// Median distance between the depths that a camera has of two heads.
double depth_difference(const Tensor& a, const Tensor& b, double yaw) {
    const stymo::Camera camera = stymo::camera_from_pose(stymo::orbit_pose(yaw, 0.0, 0.0, 5.3), {});
    const Tensor first = depth_of(a, camera, 128), second = depth_of(b, camera, 128);
    std::vector<double> differences;
    for (std::size_t i = 0; i < 128 * 128; ++i) {
        const double difference =
            double{first.values<float>()[i]} - double{second.values<float>()[i]};
        if (std::isfinite(difference)) differences.push_back(std::abs(difference));
    }
    return stymo::median(differences);
}

}  // namespace

TEST_CASE("A head goes onto a surface that is wider and deeper, and its eyes stay round",
          "[laid_head]") {
    const stymo::MorphableHead& head = stymo::builtin_head();
    Tensor surface = head.mean;
    auto points = stymo::mutable_matrix_map<float>(surface);
    points.col(0) *= 1.06F;
    points.col(2).array() += 0.08F * (3.0F * points.col(1).array()).sin() - 0.05F;
    const std::vector<stymo::SeenFace> views = views_of(surface);
    stymo::LaidHead laid{head.mean, {}, {}, Eigen::Matrix3d::Identity(), {}};
    for (std::size_t k = 0; k < laid.landmarks.size(); ++k)
        laid.landmarks[k] = stymo::project(views[0].camera,
                                           points.row(head.landmarks[k]).transpose().cast<double>())
                                .head<2>();
    lay_on_surface(head, views, laid);
    for (const double yaw : {0.0, 0.3}) {
        CHECK(depth_difference(head.mean, surface, yaw) > 0.04);
        CHECK(depth_difference(laid.vertices, surface, yaw) < 0.012);
    }
    const auto moved = stymo::matrix_map<float>(laid.vertices);
    const auto mean = stymo::matrix_map<float>(head.mean);
    CHECK((moved.row(head.landmarks[30]) - points.row(head.landmarks[30])).norm() < 0.03F);
    std::ptrdiff_t first =
        std::ranges::find(head.parts, stymo::HeadPart::eyes) - head.parts.begin();
    for (Eigen::Index i = 1; i < 100; ++i) {
        const Eigen::RowVector3f before = mean.row(first + i) - mean.row(first);
        const Eigen::RowVector3f after = moved.row(first + i) - moved.row(first);
        REQUIRE((before - after).norm() < 1e-5F);
    }
}

TEST_CASE("Without its expression a head that was turned and scaled is the neutral one, too",
          "[laid_head]") {
    const stymo::MorphableHead& head = stymo::builtin_head();
    stymo::LaidHead laid{{}, std::vector<float>(100), std::vector<float>(79), {}, {}};
    for (std::size_t k = 0; k < 10; ++k) {
        laid.identity[k] = 0.3F * static_cast<float>(k) - 1.0F;
        laid.expression[k] = 1.0F - 0.2F * static_cast<float>(k);
    }
    laid.world_from_head =
        1.1 * Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    const auto placed = [&](const Tensor& vertices) {
        Tensor result = vertices;
        stymo::mutable_matrix_map<float>(result) =
            (stymo::matrix_map<float>(vertices) * laid.world_from_head.transpose().cast<float>())
                .rowwise() +
            Eigen::RowVector3f(0.5F, -0.25F, 2.0F);
        return result;
    };
    laid.vertices = placed(head_vertices(head, laid.identity, laid.expression));
    const Tensor expected = placed(head_vertices(head, laid.identity, std::vector<float>(79)));
    const auto distance = [&](const Tensor& vertices) {
        return (stymo::matrix_map<float>(vertices) - stymo::matrix_map<float>(expected))
            .cwiseAbs()
            .maxCoeff();
    };
    CHECK(distance(laid.vertices) > 0.02F);
    CHECK(distance(neutral_vertices(head, laid)) < 1e-5F);
}

}  // namespace laid_head_tests
