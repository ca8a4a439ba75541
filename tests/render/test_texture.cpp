// Textures baked from pictures of surfaces whose colours are known in closed form.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "core/metrics.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/head_atlas.h"
#include "render/texture.h"

namespace texture_tests {

namespace {

using stymo::Tensor;

Tensor rows(std::int64_t columns, const std::vector<float>& values) {
    return Tensor::from({std::ssize(values) / columns, columns}, std::span<const float>(values));
}

/// The square [-1, 1]^2 at z, facing +z, with u to the right and v downwards.
stymo::TexturedMesh square(float z) {
    return {rows(3, {-1, 1, z, 1, 1, z, -1, -1, z, 1, -1, z}),
            rows(3, {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}),
            rows(2, {0, 0, 1, 0, 0, 1, 1, 1}),
            {{0, 2, 1}, {1, 2, 3}}};
}

/// A picture whose pixels are functions of their place in the image. The camera looks at the origin
/// from a distance of 4, and sees the square at z = 0 exactly.
template <class Color>
stymo::TextureView picture(double yaw, std::int64_t side, const Color& color) {
    stymo::TextureView view{
        stymo::camera_from_pose(stymo::orbit_pose(yaw, 0.0, 0.0, 4.0), {2.0, 0.5, 0.5}),
        Tensor({side, side, 3}), Tensor::full({side, side, 1}, 1.0)};
    const auto values = view.image.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const auto x = (static_cast<float>(i % side) + 0.5F) / static_cast<float>(side);
        const auto y = (static_cast<float>(i / side) + 0.5F) / static_cast<float>(side);
        const std::array<float, 3> seen = color(x, y);
        std::ranges::copy(seen, values.begin() + 3 * i);
    }
    return view;
}

std::array<float, 3> at(const Tensor& texture, double u, double v) {
    const Eigen::Array4f color =
        stymo::texel(texture, static_cast<float>(u), static_cast<float>(v));
    return {color[0], color[1], color[2]};
}

}  // namespace

TEST_CASE("A plane gets the picture that shows it straight", "[texture]") {
    const auto ramp = [](float x, float y) { return std::array{x, y, 0.25F}; };
    const std::vector views{picture(0.0, 32, ramp)};
    const Tensor texture = stymo::baked_texture(square(0.0F), views, Tensor::zeros({4, 4}), 64);
    for (const double u : {0.1, 0.5, 0.8})
        for (const double v : {0.2, 0.5, 0.9}) {
            const auto [red, green, blue] = at(texture, u, v);
            CHECK(red == Approx(u).margin(1e-3));
            CHECK(green == Approx(v).margin(1e-3));
            CHECK(blue == Approx(0.25).margin(1e-5));
        }
    CHECK_THROWS_AS(stymo::baked_texture(square(0.0F), views, Tensor::zeros({4, 4}), 48),
                    stymo::ValueError);
}

TEST_CASE("Pictures count with the fourth power of the cosine, and by their masks", "[texture]") {
    const auto red = [](float, float) { return std::array{1.0F, 0.0F, 0.0F}; };
    const auto blue = [](float, float) { return std::array{0.0F, 0.0F, 1.0F}; };
    const double turn = M_PI / 3.0;
    std::vector views{picture(0.0, 256, red), picture(turn, 256, blue)};
    const Tensor none = Tensor::zeros({4, 4});
    // In the middle the cosines are 1 and 1 / 2.
    const auto mixed = at(stymo::baked_texture(square(0.0F), views, none, 64), 0.5, 0.5);
    CHECK(mixed[0] == Approx(16.0 / 17.0).margin(2e-3));
    CHECK(mixed[2] == Approx(1.0 / 17.0).margin(2e-3));
    views[0].mask = Tensor::zeros({256, 256, 1});
    const auto masked = at(stymo::baked_texture(square(0.0F), views, none, 64), 0.5, 0.5);
    CHECK(masked[2] == Approx(1.0).margin(1e-5));
}

TEST_CASE("What a surface hides, or no picture shows, continues or is guessed", "[texture]") {
    const auto green = [](float, float) { return std::array{0.0F, 1.0F, 0.0F}; };
    stymo::TexturedMesh mesh = square(0.0F);
    // A second square before the first one, whose texels are those beyond u = 1 / 2.
    const stymo::TexturedMesh front = square(0.5F);
    const auto join = [](const Tensor& a, const Tensor& b) {
        std::vector<float> values(a.values<float>().begin(), a.values<float>().end());
        values.insert(values.end(), b.values<float>().begin(), b.values<float>().end());
        return rows(a.shape(1), values);
    };
    mesh.vertices = join(mesh.vertices, front.vertices);
    mesh.normals = join(mesh.normals, front.normals);
    mesh.uv = rows(2, {0, 0, 0.5F, 0, 0, 1, 0.5F, 1, 0.5F, 0, 1, 0, 0.5F, 1, 1, 1});
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 6, 5}, {5, 6, 7}};
    Tensor guess = Tensor::zeros({8, 4});
    for (std::size_t i = 0; i < 4; ++i) {
        guess.mutable_values<float>()[4 * i] = 1.0F;
        guess.mutable_values<float>()[4 * i + 3] = 0.01F;
    }
    const std::vector views{picture(0.0, 64, green)};
    const Tensor guessed = stymo::baked_texture(mesh, views, guess, 64);
    CHECK(at(guessed, 0.2, 0.5)[0] == Approx(1.0).margin(1e-4));
    CHECK(at(guessed, 0.8, 0.5)[1] == Approx(1.0).margin(1e-4));
    const Tensor continued = stymo::baked_texture(mesh, views, Tensor::zeros({8, 4}), 64);
    CHECK(at(continued, 0.2, 0.5)[1] == Approx(1.0).margin(1e-4));
}

TEST_CASE("A painted head that is baked from its pictures looks the same from between them",
          "[texture]") {
    const stymo::MorphableHead& head = stymo::builtin_head();
    const stymo::HeadAtlas atlas = stymo::head_atlas(head);
    stymo::TexturedMesh mesh{
        at_atlas_vertices(atlas, head.mean),
        at_atlas_vertices(atlas, stymo::vertex_normals(head.mean, head.triangles)), atlas.uv,
        atlas.triangles};
    Tensor painted({256, 256, 3});
    const auto values = painted.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = 0.5F + 0.3F * std::sin(0.02F * float(i / 768) + 0.03F * float(i / 3 % 256) +
                                           float(i % 3));
    mesh.texture = painted;
    const auto camera = [](double yaw) {
        return stymo::camera_from_pose(stymo::orbit_pose(yaw, 0.0, 0.0, 5.3), {});
    };
    std::vector<stymo::TextureView> views;
    for (const double yaw : {-0.4, 0.0, 0.4}) {
        const stymo::RasterImage seen = rendered_mesh(mesh, camera(yaw), {256, 256, 3});
        views.push_back({camera(yaw), seen.color, seen.coverage});
    }
    const Tensor before = rendered_mesh(mesh, camera(0.2), {128, 128, 3}).color;
    mesh.texture = baked_texture(mesh, views, Tensor::zeros({mesh.vertices.shape(0), 4}), 512);
    const Tensor after = rendered_mesh(mesh, camera(0.2), {128, 128, 3}).color;
    CHECK(stymo::peak_signal_to_noise_ratio(before, after) > 30.0);
}

}  // namespace texture_tests
