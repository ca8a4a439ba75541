#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "nn/realtime/head_mesh.h"
#include "nn/realtime/mesh_colors.h"
#include "nn/realtime/view.h"
#include "render/morphable/head.h"
#include "support/check_close.h"
#include "support/enclosed_volume.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// The level that half of the space in front of the tiny model's camera exceeds.
double middle_density(const Model& model, const Codes& w) {
    Rng rng(2);
    std::vector<double> densities =
        model.decoder().density(rng.uniform({1, 999, 3}, -1.0, 1.0), w).value().to_vector();
    std::ranges::nth_element(densities, densities.begin() + 499);
    return densities[499];
}

}  // namespace

TEST_CASE("a face's mesh lies where the field's density is the level", "[head_mesh]") {
    const Model model = tiny_model(3);
    const Codes codes = random_codes(2, 4);
    const Codes second = split_codes(Variable(Tensor::from(
        {1, code_size}, std::span(joined(codes).value().values<float>()).last(code_size))));
    const Codes w = model.decoder().map(second);
    const double level = middle_density(model, w);
    const TriangleMesh mesh = head_mesh(model, codes, 1, {.resolution = 40, .level = level});
    REQUIRE(mesh.triangles.size() > 100);
    CHECK(enclosed_volume(mesh) > 0.0);

    // But for the grid's border, where the surface is closed.
    const auto vertices = mesh.vertices.values<float>();
    std::array<float, 3> lower{}, upper{};
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        lower[i % 3] = i < 3 ? vertices[i] : std::min(lower[i % 3], vertices[i]);
        upper[i % 3] = i < 3 ? vertices[i] : std::max(upper[i % 3], vertices[i]);
    }
    std::vector<float> inner;
    for (std::size_t i = 0; i < vertices.size(); i += 3) {
        bool within = true;
        for (std::size_t axis = 0; axis < 3; ++axis)
            within = within && vertices[i + axis] > lower[axis] + 0.2F &&
                     vertices[i + axis] < upper[axis] - 0.2F;
        if (within)
            inner.insert(inner.end(), vertices.begin() + static_cast<std::ptrdiff_t>(i),
                         vertices.begin() + static_cast<std::ptrdiff_t>(i + 3));
    }
    REQUIRE(inner.size() > 60);
    const Tensor points = Tensor::from({1, static_cast<std::int64_t>(inner.size() / 3), 3},
                                       std::span<const float>(inner));
    for (const double density : model.decoder().density(points, w).value().to_vector())
        REQUIRE(density == Approx(level).epsilon(0.05));
}

TEST_CASE("a level that no density reaches is refused with the largest density", "[head_mesh]") {
    const Model model = tiny_model(3);
    const std::string message = error_message<ValueError>([&] {
        static_cast<void>(head_mesh(model, random_codes(1, 4), 0, {.resolution = 4, .level = 1e6}));
    });
    CHECK_THAT(message, Catch::Contains("no density of this face reaches 1e+06; the largest is"));
    CHECK_THROWS_AS(head_mesh(model, random_codes(1, 4), 0, {.resolution = 1}), ValueError);
}

TEST_CASE("a vertex has the colour that the images show where it is seen", "[head_mesh]") {
    const Model model = tiny_model(3);
    const Codes codes = random_codes(1, 4);
    // A small triangle that faces the camera, and one behind it that nobody sees.
    const TriangleMesh mesh{
        Tensor::from({6, 3},
                     std::vector<double>{-0.3, -0.3, 0.9, 0.3, -0.3, 0.9, 0.0, 0.3, 0.9,  //
                                         -0.05, -0.05, 0.0, 0.05, -0.05, 0.0, 0.0, 0.05, 0.0})
            .to(DType::float32),
        {{0, 1, 2}, {3, 4, 5}}};
    const Tensor colors =
        mesh_colors(model, codes, mesh, vertex_normals(mesh.vertices, mesh.triangles),
                    {.mode = RenderMode::exact, .samples_per_ray = 4});
    CHECK(colors.shape() == Shape{6, 3});
    CHECK(colors.all_finite());
    const auto values = colors.values<float>();
    // Within what the nine images have around the middle.
    const Tensor image =
        render_view(model, codes, 0, model_camera(model, 0.0, 0.0, 0.0), {.samples_per_ray = 4})
            .image;
    for (std::size_t channel = 0; channel < 3; ++channel) {
        const float middle = image.values<float>()[3 * (8 * 16 + 8) + channel];
        CHECK(values[channel] == Approx(middle).margin(0.25));
        CHECK(values[9 + channel] ==
              Approx((values[channel] + values[3 + channel] + values[6 + channel]) / 3.0)
                  .margin(0.1));
    }
}
