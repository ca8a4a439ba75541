#include <catch2/catch.hpp>
#include <cmath>

#include "core/tensor_eigen.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/head_atlas.h"
#include "render/rasterizer.h"

namespace {

/// Area of the triangles of an atlas, and of the texels that they cover: what is missing is shared.
struct Areas {
    double triangles = 0.0;
    double texels = 0.0;
};

Areas areas_of(const stymo::HeadAtlas& atlas) {
    Areas areas;
    const auto uv = stymo::matrix_map<float>(atlas.uv);
    stymo::Tensor plane = stymo::Tensor::full({atlas.uv.shape(0), 3}, 1.0);
    stymo::mutable_matrix_map<float>(plane).leftCols(2) = uv;
    for (const auto& triangle : atlas.triangles) {
        const auto corner = [&](std::size_t k) -> Eigen::Vector2d {
            return uv.row(triangle[k]).transpose().cast<double>();
        };
        const Eigen::Vector2d a = corner(1) - corner(0), b = corner(2) - corner(0);
        areas.triangles += 0.5 * std::abs(a[0] * b[1] - a[1] * b[0]);
    }
    const stymo::RasterImage drawn = stymo::rasterize(
        plane, plane, atlas.triangles, {.intrinsics = {1.0, 0.0, 0.0}}, {2048, 2048, 1});
    for (const float share : drawn.coverage.values<float>())
        areas.texels += double{share} / 2048.0 / 2048.0;
    return areas;
}

/// Adds a bent sheet of skin around the vertical axis, `width` radians wide, without a grid.
void add_sheet(stymo::MorphableHead& head, float radius, float width, float height) {
    constexpr std::int32_t cells = 12;
    std::vector<float> points(head.mean.values<float>().begin(), head.mean.values<float>().end());
    const auto first = static_cast<std::int32_t>(points.size() / 3);
    for (std::int32_t i = 0; i <= cells; ++i)
        for (std::int32_t k = 0; k <= cells; ++k) {
            const float angle = width * (float(k) / cells - 0.5F);
            for (const float value : {radius * std::sin(angle), height * (float(i) / cells - 0.5F),
                                      radius * std::cos(angle)})
                points.push_back(value);
        }
    for (std::int32_t i = 0; i < cells; ++i)
        for (std::int32_t k = 0; k < cells; ++k) {
            const std::int32_t at = first + i * (cells + 1) + k;
            head.triangles.push_back({at, at + 1, at + cells + 1});
            head.triangles.push_back({at + 1, at + cells + 2, at + cells + 1});
        }
    const auto count = static_cast<std::int64_t>(points.size() / 3);
    head.mean = stymo::Tensor::from({count, 3}, std::span<const float>(points));
    head.parts.assign(static_cast<std::size_t>(count), stymo::HeadPart::skin);
}

}  // namespace

TEST_CASE("The built-in head's triangles keep their vertices and share no texel", "[atlas]") {
    const stymo::MorphableHead& head = stymo::builtin_head();
    const stymo::HeadAtlas atlas = stymo::head_atlas(head);
    REQUIRE(atlas.triangles.size() == head.triangles.size());
    const auto uv = stymo::matrix_map<float>(atlas.uv);
    CHECK(uv.minCoeff() >= 0.0F);
    CHECK(uv.maxCoeff() <= 1.0F);
    for (std::size_t t = 0; t < atlas.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k)
            REQUIRE(atlas.vertex[std::size_t(atlas.triangles[t][k])] == head.triangles[t][k]);
    const Areas areas = areas_of(atlas);
    CHECK(areas.texels == Approx(areas.triangles).epsilon(2e-3));
    CHECK(areas.triangles > 0.8);
}

TEST_CASE("What a scan's outside hides has texels of its own, also in two layers", "[atlas]") {
    stymo::MorphableHead head;
    head.mean = stymo::Tensor({0, 3});
    add_sheet(head, 1.0F, 3.0F, 2.0F);
    add_sheet(head, 0.9F, 0.5F, 0.4F);  // the inside of a nostril
    add_sheet(head, 0.8F, 0.4F, 0.3F);
    // Joined at one corner each, as the wall of a nostril at its rim.
    head.triangles.push_back({0, 169, 338});
    const stymo::HeadAtlas atlas = stymo::head_atlas(head);
    for (std::size_t t = 0; t < atlas.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k)
            REQUIRE(atlas.vertex[std::size_t(atlas.triangles[t][k])] == head.triangles[t][k]);
    const Areas areas = areas_of(atlas);
    CHECK(areas.texels == Approx(areas.triangles).epsilon(0.01));
}
