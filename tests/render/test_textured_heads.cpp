#include <catch2/catch.hpp>
#include <limits>
#include <numbers>

#include "core/error.h"
#include "core/io/scratch_folder.h"
#include "render/morphable/textured_heads.h"
#include "render/rasterizer.h"
#include "render/spherical_harmonics.h"
#include "support/textured_squares.h"

namespace textured_heads_tests {

using stymo::Tensor;

[[nodiscard]] stymo::TexturedHeads read(const stymo::TensorFile& contents) {
    const stymo::ScratchFolder folder;
    stymo::write_tensor_file(folder / "heads.safetensors", contents);
    return stymo::read_textured_heads(folder / "heads.safetensors");
}

[[nodiscard]] std::string refusal(const stymo::TensorFile& contents) {
    try {
        static_cast<void>(read(contents));
    } catch (const stymo::FileError& error) {
        return error.what();
    }
    return "";
}

[[nodiscard]] Eigen::Vector3f vertex(const stymo::TexturedSurface& surface, std::size_t index) {
    return Eigen::Map<const Eigen::Vector3f>(&surface.vertices.values<float>()[3 * index]);
}

/// The image, 16 x 16 pixels, is as wide as the rectangle, which covers the rows 4 to 11.
[[nodiscard]] stymo::RasterImage picture(const stymo::TexturedSurface& surface) {
    const stymo::Pose pose{0.0, 0.0, 0.0, {0.0, -0.235, 0.68 + 2.0 * 1.14}};
    return stymo::render_textured(surface, stymo::neutral_light(),
                                  stymo::camera_from_pose(pose, {2.0, 0.5, 0.5}), 16);
}

[[nodiscard]] float channel(const stymo::RasterImage& image, std::size_t pixel, std::size_t index) {
    return image.color.values<float>()[7 * pixel + index];
}

[[nodiscard]] float white() {
    return static_cast<float>(
        stymo::irradiance(stymo::neutral_light(), Eigen::Vector3d(0.0, 0.0, -1.0))[0]);
}

}  // namespace textured_heads_tests

using namespace textured_heads_tests;

TEST_CASE("A head with weight 1 is itself, with eyes and mouth where the built-in head has them") {
    const stymo::TexturedHeads heads = read(stymo::textured_squares());
    const auto surface = stymo::textured_surface(heads, {{1.0F, 0.0F}}, std::vector<float>{0.0F});
    CHECK(vertex(surface, 0).isApprox(Eigen::Vector3f(-0.57F, 0.05F, 0.68F), 1e-6F));
    CHECK(vertex(surface, 3).isApprox(Eigen::Vector3f(0.57F, -0.52F, 0.68F), 1e-6F));
    CHECK(surface.landmarks[54].isApprox(Eigen::Vector3d(0.57, -0.52, 0.68), 1e-6));
    const auto open = stymo::textured_surface(heads, {{1.0F, 0.0F}}, std::vector<float>{1.0F});
    CHECK(vertex(open, 0).isApprox(vertex(surface, 0)));
    CHECK(vertex(open, 3).isApprox(Eigen::Vector3f(0.57F, -0.805F, 0.68F), 1e-6F));
}

TEST_CASE("A textured square shows its texture") {
    const stymo::TexturedHeads heads = read(stymo::textured_squares());
    const auto image =
        picture(stymo::textured_surface(heads, {{1.0F, 0.0F}}, std::vector<float>{0.0F}));
    for (std::size_t row = 0; row < 16; ++row) {
        for (std::size_t column = 0; column < 16; ++column) {
            const std::size_t pixel = 16 * row + column;
            const bool covered = row >= 4 && row < 12;
            CHECK(image.coverage.values<float>()[pixel] == Approx(covered ? 1.0 : 0.0));
            CHECK(channel(image, pixel, 6) == Approx(row >= 4 && row < 8 ? 1.0 : 0.0));
            // Half a texel from the border the texture is constant.
            if (row < 5 || row > 10 || column < 2 || column > 13) continue;
            const double u = (static_cast<double>(column) + 0.5) / 16.0;
            const double v = (static_cast<double>(row) - 3.5) / 8.0;
            const double texel = 10.0 + 60.0 * (4.0 * u - 0.5) + 20.0 * (4.0 * v - 0.5);
            CHECK(channel(image, pixel, 0) ==
                  Approx(std::min(1.0, texel / 255.0 * white())).margin(2e-5));
            CHECK(channel(image, pixel, 5) == Approx(row < 8 ? channel(image, pixel, 2) : 0.0F));
        }
    }
}

TEST_CASE("Skin that is seen from within belongs to the head, and is dark") {
    const stymo::TexturedHeads heads = read(stymo::textured_squares());
    const auto surface = stymo::textured_surface(heads, {{0.0F, 1.0F}}, std::vector<float>{0.0F});
    const auto behind = stymo::orbit_pose(std::numbers::pi, 0.0, 0.0, 2.28 - 0.68);
    const auto image = stymo::render_textured(surface, stymo::neutral_light(),
                                              stymo::camera_from_pose(behind, {2.0, 0.5, 0.5}), 16);
    const std::size_t pixel = 16 * 11 + 8;  // of the lower half, which is not head
    CHECK(channel(image, pixel, 6) == Approx(1.0));
    CHECK(channel(image, pixel, 0) == Approx(0.2 * 50.0 / 255.0 * white()));
}

TEST_CASE("Colours are mixed, and hair follows the skin with holes where it is transparent") {
    const stymo::TexturedHeads heads = read(stymo::textured_squares());
    stymo::TexturedPerson person{{0.0F, 1.0F}, 0};
    person.skin_tint = Eigen::Vector3f(1.0F, 0.5F, 1.0F);
    person.hair_tint = Eigen::Vector3f(0.5F, 1.0F, 1.0F);
    const auto surface = stymo::textured_surface(heads, person, std::vector<float>{1.0F});
    CHECK(vertex(surface, 7).isApprox(Eigen::Vector3f(0.57F, -0.805F, 0.68F + 0.057F), 1e-6F));
    const auto image = picture(surface);
    const std::size_t row = 6 * 16;
    CHECK(channel(image, row + 3, 0) == Approx(50.0 / 255.0 * white()));
    CHECK(channel(image, row + 3, 1) == Approx(25.0 / 255.0 * white()));
    CHECK(channel(image, row + 14, 0) == Approx(100.0 / 255.0 * white()));
    CHECK(channel(image, 16 * 11 + 3, 6) == 0.0F);
    CHECK(channel(image, 16 * 11 + 14, 6) == 1.0F);

    const auto mixed = stymo::textured_surface(heads, {{0.25F, 0.75F}}, std::vector<float>{0.0F});
    CHECK(mixed.layers[0].texture.values<float>()[3] == Approx(0.25 * 70.0 + 0.75 * 50.0));
}

TEST_CASE("Colours for each sample are those of the vertices where they are the same function") {
    const Tensor corners = Tensor::from(
        {3, 3}, std::span<const float>(std::vector<float>{-1, 1, 0, -1, -1, 1, 1, -1, 0}));
    const std::vector<std::array<std::int32_t, 3>> triangles{{0, 1, 2}};
    const auto camera = stymo::camera_from_pose({0.1, 0.2, 0.0, {0.0, 0.0, 4.0}}, {2.0, 0.5, 0.5});
    const auto weights = [](std::int32_t, const std::array<double, 3>& weight,
                            std::span<float> to) {
        for (std::size_t k = 0; k < 3; ++k)
            to[k] = static_cast<float>(weight[0] * (k == 0) + weight[1] * (k == 1) +
                                       weight[2] * (k == 2));
        return true;
    };
    const Tensor unit =
        Tensor::from({3, 3}, std::span<const float>(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
    const auto a = stymo::rasterize(corners, unit, triangles, camera, {12, 12, 3});
    const auto b = stymo::rasterize(corners, triangles, 3, weights, camera, {12, 12, 3});
    for (std::size_t i = 0; i < 3 * 144; ++i)
        CHECK(a.color.values<float>()[i] == Approx(b.color.values<float>()[i]).margin(1e-6));
}

TEST_CASE("A file that has no textured heads is refused with the tensor's name") {
    const stymo::TensorFile good = stymo::textured_squares();
    for (const auto& [name, tensor] : good.tensors) {
        if (name == "hair.0.vertices") continue;  // without it there is no hair
        stymo::TensorFile file = good;
        file.tensors.erase(name);
        CHECK_THAT(refusal(file),
                   Catch::Contains("\"" + name + "\"") && Catch::Contains("heads.safetensors"));
        file.tensors[name] = Tensor::full({7}, 1.0);
        CHECK_THAT(refusal(file), Catch::Contains("\"" + name + "\""));
        file = good;
        file.tensors[name].mutable_values<float>()[0] = std::numeric_limits<float>::infinity();
        CHECK_THAT(refusal(file), Catch::Contains("\"" + name + "\" holds values that are not"));
    }
    for (const char* name : {"triangles", "welded", "landmarks68", "hair.0.owner",
                             "hair.0.triangles", "hair.0.anchors"}) {
        stymo::TensorFile file = good;
        file.tensors[name].mutable_values<float>()[0] = 4.0F;
        CHECK_THAT(refusal(file), Catch::Contains(std::string("\"") + name + "\" names number 4"));
    }
    stymo::TensorFile file = good;
    file.metadata["expressions"] = "one two";
    CHECK_THAT(refusal(file), Catch::Contains("has 1 rows, its metadata 2 names"));
}

TEST_CASE("Weights and hair that do not belong to the heads are refused") {
    const stymo::TexturedHeads heads = read(stymo::textured_squares());
    const std::vector<float> rest{0.0F};
    CHECK_THROWS_AS(stymo::textured_surface(heads, {{1.0F}}, rest), stymo::ShapeError);
    CHECK_THROWS_AS(stymo::textured_surface(heads, {{1.0F, 0.0F}}, {}), stymo::ShapeError);
    CHECK_THROWS_AS(stymo::textured_surface(heads, {{1.0F, 0.0F}, 1}, rest), stymo::ValueError);
}
