#include <catch2/catch.hpp>

#include "nn/realtime/head_mesh.h"

using namespace stymo;

TEST_CASE("a grid covers its box with cubes", "[mesh]") {
    const VertexGrid grid = cover({{-1.0, 0.0, 2.0}, {1.0, 1.1, 2.5}}, 8);
    CHECK(grid.spacing == Approx(0.25));
    CHECK(grid.vertices == std::array<std::int64_t, 3>{9, 6, 3});
    const std::int64_t index = (1 * 6 + 4) * 9 + 3;
    CHECK(grid.coordinates(index) == std::array<std::int64_t, 3>{3, 4, 1});
    CHECK(grid.position(index)[1] == Approx(1.0));
}
