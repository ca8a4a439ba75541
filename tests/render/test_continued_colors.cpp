#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "core/error.h"
#include "render/continued_colors.h"

namespace continued_colors_tests {

using stymo::Tensor;

TEST_CASE("Colours continue over a surface as a harmonic function, and stay where they are known",
          "[texture]") {
    // A ring of eight squares; two opposite edges are known, red 0 and red 1.
    constexpr std::int32_t columns = 8;
    std::vector<std::array<std::int32_t, 3>> triangles;
    for (std::int32_t i = 0; i < columns; ++i) {
        const std::int32_t a = 2 * i, b = 2 * ((i + 1) % columns);
        // Both diagonals of each square, so that the ring is the same on both sides.
        triangles.insert(triangles.end(),
                         {{a, a + 1, b}, {a + 1, b + 1, b}, {a, a + 1, b + 1}, {a, b + 1, b}});
    }
    // A triangle of its own, of which nothing is known.
    triangles.push_back({2 * columns, 2 * columns + 1, 2 * columns + 2});
    Tensor seen = Tensor::zeros({2 * columns + 3, 4});
    const auto values = seen.mutable_values<float>();
    for (const std::size_t i : {0, 1, 8, 9}) {
        values[4 * i] = i < 8 ? 0.0F : 1.0F;
        values[4 * i + 1] = 0.5F;
        values[4 * i + 3] = 1e6F;
    }
    const Tensor colors = stymo::continued_colors(seen, triangles);
    REQUIRE(colors.shape() == stymo::Shape{2 * columns + 3, 3});
    for (std::size_t i = 0; i < 2 * columns; ++i) {
        const std::size_t column = i / 2;
        const double distance = static_cast<double>(std::min(column, columns - column));
        CHECK(colors.values<float>()[3 * i] == Approx(distance / 4.0).margin(1e-4));
        CHECK(colors.values<float>()[3 * i + 1] == Approx(0.5).margin(1e-4));
    }
    for (std::size_t i = 2 * columns; i < 2 * columns + 3; ++i)
        CHECK(colors.values<float>()[3 * i] == Approx(0.5).margin(1e-4));
    CHECK_THROWS_AS(stymo::continued_colors(Tensor::zeros({4, 3}), triangles), stymo::ShapeError);
}

}  // namespace continued_colors_tests
