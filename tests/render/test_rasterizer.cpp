#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "render/rasterizer.h"

namespace {

using stymo::Tensor;
using Triangles = std::vector<std::array<std::int32_t, 3>>;

[[nodiscard]] Tensor rows(const std::vector<float>& values) {
    return Tensor::from({static_cast<std::int64_t>(values.size()) / 3, 3},
                        std::span<const float>(values));
}

/// At (0, 0, 4), looking along -z; the plane z = 0 spans 4 / 2 = 2 units.
[[nodiscard]] stymo::Camera camera() {
    return stymo::camera_from_pose({0.0, 0.0, 0.0, {0.0, 0.0, 4.0}}, {2.0, 0.5, 0.5});
}

/// World corners of a triangle in the plane z = 0 that covers the lower left half of the image.
[[nodiscard]] Tensor half_image() {
    return rows({-1, 1, 0, -1, -1, 0, 1, -1, 0});
}

}  // namespace

TEST_CASE("A triangle over half of the image covers half of it, at the plane's depth") {
    const Tensor white = Tensor::full({3, 3}, 1.0);
    const auto image =
        stymo::rasterize(half_image(), white, Triangles{{0, 1, 2}}, camera(), {16, 16, 8});
    double area = 0.0;
    const auto coverage = image.coverage.values<float>();
    const auto color = image.color.values<float>();
    const auto depth = image.depth.values<float>();
    for (std::size_t pixel = 0; pixel < coverage.size(); ++pixel) {
        const std::size_t row = pixel / 16;
        const std::size_t column = pixel % 16;
        area += static_cast<double>(coverage[pixel]) / 256.0;
        CHECK(color[3 * pixel] == Approx(coverage[pixel]).margin(1e-6));
        if (column < row) CHECK(coverage[pixel] == Approx(1.0));
        if (column > row) {
            CHECK(coverage[pixel] == 0.0F);
            CHECK(image.triangle[pixel] == -1);
            CHECK(std::isinf(depth[pixel]));
        } else {
            CHECK(image.triangle[pixel] == 0);
            CHECK(depth[pixel] == Approx(4.0).epsilon(1e-6));
        }
    }
    // 8 x 8 samples in each of the 16 pixels of the diagonal; samples on it count.
    CHECK(area == Approx(0.5).margin(16.0 * 4.0 / 64.0 / 256.0 + 1e-6));
}

TEST_CASE("Depth and colours of a slanted triangle are those of the plane, perspective and all") {
    // The plane z = x, coloured by x: on the ray through image x the closed form is x_world = 4 u /
    // (1 + u), u = (x - 0.5) / 2.
    const Tensor vertices = rows({-2, -3, -2, 2, -3, 2, 0, 6, 0});
    const Tensor colors = rows({0, 0, 0, 1, 0, 0, 0.5F, 0, 0});
    const auto image =
        stymo::rasterize(vertices, colors, Triangles{{0, 1, 2}}, camera(), {32, 32, 1});
    const auto color = image.color.values<float>();
    const auto depth = image.depth.values<float>();
    for (std::size_t column = 8; column < 24; ++column) {
        const std::size_t pixel = 16 * 32 + column;
        const double u = ((static_cast<double>(column) + 0.5) / 32.0 - 0.5) / 2.0;
        const double x = 4.0 * u / (1.0 + u);
        CHECK(depth[pixel] == Approx(4.0 - x).epsilon(1e-5));
        CHECK(color[3 * pixel] == Approx((x + 2.0) / 4.0).margin(1e-5));
    }
}

TEST_CASE("The nearer triangle hides the farther one, in either order") {
    const Tensor vertices = rows({-3, -3, 0, 3, -3, 0, 0, 4, 0, -3, -3, 1, 3, -3, 1, 0, 4, 1});
    const Tensor colors = rows({1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0});
    for (const Triangles& triangles :
         {Triangles{{0, 1, 2}, {3, 4, 5}}, Triangles{{3, 4, 5}, {0, 1, 2}}}) {
        const auto image = stymo::rasterize(vertices, colors, triangles, camera(), {8, 8, 2});
        const std::size_t middle = 4 * 8 + 4;
        CHECK(image.color.values<float>()[3 * middle] == 0.0F);
        CHECK(image.color.values<float>()[3 * middle + 1] == Approx(1.0));
        CHECK(image.depth.values<float>()[middle] == Approx(3.0).epsilon(1e-6));
    }
}

TEST_CASE("Triangles that share edges leave no gap") {
    // A fan around a centre that lies on no sample grid line.
    std::vector<float> points{0.0137F, -0.0271F, 0.0F};
    Triangles fan;
    constexpr int blades = 37;
    for (int k = 0; k < blades; ++k) {
        const double angle = 6.283185307179586 * k / blades;
        points.insert(points.end(), {static_cast<float>(3.0 * std::cos(angle)),
                                     static_cast<float>(3.0 * std::sin(angle)), 0.0F});
        fan.push_back({0, k + 1, (k + 1) % blades + 1});
    }
    const auto image = stymo::rasterize(rows(points), Tensor::full({blades + 1, 3}, 1.0), fan,
                                        camera(), {50, 50, 3});
    for (const float value : image.coverage.values<float>())
        CHECK(value == Approx(1.0).epsilon(1e-6));
}

TEST_CASE("The image does not depend on the number of threads") {
    const auto draw = [](int threads) {
        stymo::set_thread_count(threads);
        const Tensor colors = rows({0, 0.3F, 0, 1, 0, 0.7F, 0.5F, 0, 0});
        return stymo::rasterize(half_image(), colors, Triangles{{0, 1, 2}}, camera(), {67, 67, 3})
            .color.to_vector();
    };
    const auto one = draw(1);
    const auto two = draw(2);
    stymo::set_thread_count(0);
    CHECK(one == two);
}

TEST_CASE("What reaches behind the camera is left out and wrong input is refused") {
    const Tensor white = Tensor::full({3, 3}, 1.0);
    const auto image = stymo::rasterize(rows({-1, -1, 0, 1, -1, 0, 0, 1, 5}), white,
                                        Triangles{{0, 1, 2}}, camera(), {8, 8, 1});
    for (const float value : image.coverage.values<float>()) CHECK(value == 0.0F);
    CHECK_THROWS_AS(
        stymo::rasterize(half_image(), white, Triangles{{0, 1, 3}}, camera(), {8, 8, 1}),
        stymo::ValueError);
    CHECK_THROWS_AS(
        stymo::rasterize(half_image(), white, Triangles{{0, 1, 2}}, camera(), {8, 8, 0}),
        stymo::ValueError);
    CHECK_THROWS_AS(
        stymo::rasterize(half_image(), Tensor::full({2, 3}, 1.0), Triangles{}, camera(), {8, 8, 1}),
        stymo::ShapeError);
}
