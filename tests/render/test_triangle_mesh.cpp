#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "core/rng.h"
#include "render/morphable/head.h"
#include "render/triangle_mesh.h"
#include "support/enclosed_volume.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// Values of a function of position at the vertices of a cube of `cells` cells from -1 to 1 along
/// each axis.
Tensor sampled(std::int64_t cells, const std::function<double(double, double, double)>& field) {
    Tensor values({cells + 1, cells + 1, cells + 1});
    const std::span<float> numbers = values.mutable_values<float>();
    const auto coordinate = [&](std::int64_t i) {
        return -1.0 + 2.0 * static_cast<double>(i) / static_cast<double>(cells);
    };
    std::size_t next = 0;
    for (std::int64_t z = 0; z <= cells; ++z) {
        for (std::int64_t y = 0; y <= cells; ++y) {
            for (std::int64_t x = 0; x <= cells; ++x)
                numbers[next++] =
                    static_cast<float>(field(coordinate(x), coordinate(y), coordinate(z)));
        }
    }
    return values;
}

TriangleMesh surface(std::int64_t cells, double level,
                     const std::function<double(double, double, double)>& field) {
    return isosurface(sampled(cells, field), {-1.0, -1.0, -1.0}, 2.0 / static_cast<double>(cells),
                      level);
}

/// Signed distance to a sphere, positive inside.
auto sphere(double x, double y, double z, double radius) {
    return [=](double a, double b, double c) { return radius - std::hypot(a - x, b - y, c - z); };
}

/// Every directed edge occurs once, and so does the opposite one: closed, and turned the same way
/// throughout.
bool is_watertight(const TriangleMesh& mesh) {
    std::map<std::pair<std::int32_t, std::int32_t>, int> edges;
    for (const auto& triangle : mesh.triangles) {
        for (std::size_t i = 0; i < 3; ++i) ++edges[{triangle[i], triangle[(i + 1) % 3]}];
    }
    return std::ranges::all_of(edges, [&](const auto& edge) {
        const auto opposite = edges.find({edge.first.second, edge.first.first});
        return edge.second == 1 && opposite != edges.end();
    });
}

/// V - E + F of a closed mesh, in which each triangle has half of three edges.
std::int64_t euler_characteristic(const TriangleMesh& mesh) {
    return mesh.vertices.shape(0) - static_cast<std::int64_t>(mesh.triangles.size()) / 2;
}

double area(const TriangleMesh& mesh) {
    const auto vertices = mesh.vertices.values<float>();
    double sum = 0.0;
    for (const auto& triangle : mesh.triangles) {
        const auto side = [&](std::size_t end, std::size_t axis) {
            return static_cast<double>(
                vertices[3 * static_cast<std::size_t>(triangle[end]) + axis] -
                vertices[3 * static_cast<std::size_t>(triangle[0]) + axis]);
        };
        sum += 0.5 * std::hypot(side(1, 1) * side(2, 2) - side(1, 2) * side(2, 1),
                                side(1, 2) * side(2, 0) - side(1, 0) * side(2, 2),
                                side(1, 0) * side(2, 1) - side(1, 1) * side(2, 0));
    }
    return sum;
}

}  // namespace

TEST_CASE("the surface of a sphere is closed and has a sphere's area, volume and normals",
          "[mesh]") {
    const double radius = 0.7;
    const TriangleMesh mesh = surface(32, 0.0, sphere(0.05, -0.1, 0.0, radius));
    CHECK(is_watertight(mesh));
    CHECK(euler_characteristic(mesh) == 2);
    CHECK(enclosed_volume(mesh) ==
          Approx(4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3)).epsilon(5e-3));
    CHECK(area(mesh) == Approx(4.0 * std::numbers::pi * radius * radius).epsilon(5e-3));
    const std::vector<double> vertices = mesh.vertices.to_vector();
    const std::vector<double> normals = vertex_normals(mesh.vertices, mesh.triangles).to_vector();
    double worst_distance = 0.0, least_cosine = 1.0;
    for (std::size_t i = 0; i < vertices.size(); i += 3) {
        const double x = vertices[i] - 0.05, y = vertices[i + 1] + 0.1, z = vertices[i + 2];
        const double distance = std::hypot(x, y, z);
        worst_distance = std::max(worst_distance, std::abs(distance - radius));
        least_cosine = std::min(
            least_cosine, (x * normals[i] + y * normals[i + 1] + z * normals[i + 2]) / distance);
    }
    // A chord of the longest edge, sqrt(3) / 16, is so far from the circle.
    CHECK(worst_distance < 2.2e-3);
    CHECK(least_cosine > 0.97);
}

TEST_CASE("a plane is met exactly, for the field is linear", "[mesh]") {
    const TriangleMesh mesh =
        surface(4, 0.3, [](double x, double y, double z) { return x + 0.5 * y - 0.25 * z; });
    const auto vertices = mesh.vertices.values<float>();
    int on_plane = 0;
    for (std::size_t i = 0; i < vertices.size(); i += 3) {
        const float value = vertices[i] + 0.5F * vertices[i + 1] - 0.25F * vertices[i + 2];
        const bool beyond = std::max({std::abs(vertices[i]), std::abs(vertices[i + 1]),
                                      std::abs(vertices[i + 2])}) > 1.0F;
        if (beyond) continue;
        ++on_plane;
        CHECK(value == Approx(0.3).margin(1e-6));
    }
    CHECK(on_plane > 20);
    CHECK(is_watertight(mesh));
}

TEST_CASE("surfaces of noise are closed too, and those that reach the border are closed there",
          "[mesh]") {
    Rng rng(1);
    for (const std::int64_t cells : {1, 2, 9}) {
        const TriangleMesh mesh =
            surface(cells, 0.0, [&](double, double, double) { return rng.normal(); });
        CHECK(is_watertight(mesh));
        CHECK(enclosed_volume(mesh) > 0.0);
    }
    const TriangleMesh all = surface(4, 0.0, [](double, double, double) { return 1.0; });
    CHECK(is_watertight(all));
    CHECK(euler_characteristic(all) == 2);
    // A vertex on the level itself counts as inside.
    CHECK(is_watertight(
        surface(3, 0.0, [](double x, double, double) { return x > 0.0 ? 0.0 : -1.0; })));
}

TEST_CASE("a torus has the Euler characteristic 0", "[mesh]") {
    const TriangleMesh mesh = surface(32, 0.0, [](double x, double y, double z) {
        return 0.25 - std::hypot(std::hypot(x, y) - 0.6, z);
    });
    CHECK(is_watertight(mesh));
    CHECK(euler_characteristic(mesh) == 0);
    CHECK(enclosed_volume(mesh) ==
          Approx(2.0 * std::numbers::pi * std::numbers::pi * 0.6 * 0.25 * 0.25).epsilon(0.03));
}

TEST_CASE("the largest of two spheres is kept, alone and unchanged", "[mesh]") {
    const auto small = sphere(-0.7, 0.0, 0.0, 0.2), large = sphere(0.4, 0.0, 0.0, 0.4);
    const TriangleMesh both = surface(24, 0.0, [&](double x, double y, double z) {
        return std::max(small(x, y, z), large(x, y, z));
    });
    const TriangleMesh expected = surface(24, 0.0, large);
    CHECK(euler_characteristic(both) == 4);
    const TriangleMesh kept = largest_piece(both);
    CHECK(is_watertight(kept));
    CHECK(kept.vertices.shape(0) == expected.vertices.shape(0));
    CHECK(kept.triangles.size() == expected.triangles.size());
    CHECK(enclosed_volume(kept) == Approx(enclosed_volume(expected)));
}

TEST_CASE("no surface is no triangles, and what is no grid is refused", "[mesh]") {
    const TriangleMesh none = surface(3, 2.0, [](double, double, double) { return 1.0; });
    CHECK(none.triangles.empty());
    CHECK(none.vertices.shape(0) == 0);
    CHECK(largest_piece(none).triangles.empty());
    // A mesh whose only piece is turned inside out, after a vertex that belongs to none.
    const TriangleMesh inside_out{
        Tensor::from({5, 3}, std::vector<float>{9, 9, 9, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}),
        {{1, 2, 3}, {1, 4, 2}, {1, 3, 4}, {2, 4, 3}}};
    REQUIRE(enclosed_volume(inside_out) < 0.0);
    CHECK(largest_piece(inside_out).triangles.size() == 4);
    CHECK_THROWS_AS(isosurface(Tensor::zeros({1, 2, 2}), {}, 1.0, 0.0), ShapeError);
    CHECK_THROWS_AS(
        isosurface(Tensor::full({2, 2, 2}, std::numeric_limits<double>::infinity()), {}, 1.0, 0.0),
        ValueError);
}
