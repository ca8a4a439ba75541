#include <catch2/catch.hpp>
#include <cmath>

#include "core/tensor_eigen.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/head_atlas.h"
#include "render/rasterizer.h"

TEST_CASE("The built-in head's triangles keep their vertices and share no texel", "[atlas]") {
    const stymo::MorphableHead& head = stymo::builtin_head();
    const stymo::HeadAtlas atlas = stymo::head_atlas(head);
    REQUIRE(atlas.triangles.size() == head.triangles.size());
    const auto uv = stymo::matrix_map<float>(atlas.uv);
    CHECK(uv.minCoeff() >= 0.0F);
    CHECK(uv.maxCoeff() <= 1.0F);
    double area = 0.0;
    stymo::Tensor plane = stymo::Tensor::full({atlas.uv.shape(0), 3}, 1.0);
    stymo::mutable_matrix_map<float>(plane).leftCols(2) = uv;
    for (std::size_t t = 0; t < atlas.triangles.size(); ++t) {
        std::array<Eigen::Vector2d, 3> corner;
        for (std::size_t k = 0; k < 3; ++k) {
            const std::int32_t vertex = atlas.triangles[t][k];
            REQUIRE(atlas.vertex[std::size_t(vertex)] == head.triangles[t][k]);
            corner[k] = uv.row(vertex).transpose().cast<double>();
        }
        const Eigen::Vector2d a = corner[1] - corner[0], b = corner[2] - corner[0];
        area += 0.5 * std::abs(a[0] * b[1] - a[1] * b[0]);
    }
    const stymo::RasterImage drawn = stymo::rasterize(
        plane, plane, atlas.triangles, {.intrinsics = {1.0, 0.0, 0.0}}, {2048, 2048, 1});
    double covered = 0.0;
    for (const float share : drawn.coverage.values<float>()) covered += double{share};
    // Texels beyond the number that triangles cover would be shared.
    CHECK(covered / 2048.0 / 2048.0 == Approx(area).epsilon(2e-3));
    CHECK(area > 0.8);
}
