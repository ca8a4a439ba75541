#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/rng.h"
#include "nn/engine/feature_basis.h"
#include "nn/realtime/vertex_grid.h"

using namespace stymo;

namespace {

/// A value for each vertex.
template <class Function>
std::vector<float> at_vertices(const VertexGrid& grid, Function function) {
    std::vector<float> values(static_cast<std::size_t>(grid.size()));
    for (std::int64_t i = 0; i < grid.size(); ++i)
        values[static_cast<std::size_t>(i)] = static_cast<float>(function(grid.position(i)));
    return values;
}

}  // namespace

TEST_CASE("a grid covers its box with cubes", "[baked]") {
    const VertexGrid grid = cover({{-1.0, 0.0, 2.0}, {1.0, 1.1, 2.5}}, 8);
    CHECK(grid.spacing == Approx(0.25));
    CHECK(grid.vertices == std::array<std::int64_t, 3>{9, 6, 3});
    CHECK(refined(grid).vertices == std::array<std::int64_t, 3>{17, 11, 5});
    const std::int64_t index = grid.index(3, 4, 1);
    CHECK(grid.coordinates(index) == std::array<std::int64_t, 3>{3, 4, 1});
    CHECK(grid.position(index)[1] == Approx(1.0));
}

TEST_CASE("a product of linear functions is prolonged exactly", "[baked]") {
    const auto function = [](const Eigen::Vector3d& p) {
        return (1.0 + p[0]) * (2.0 - p[1]) * (0.5 + 3.0 * p[2]);
    };
    const VertexGrid grid = cover({{-1.0, -1.0, -1.0}, {1.0, 0.5, 0.75}}, 4);
    const std::vector<float> fine = prolonged(grid, at_vertices(grid, function));
    const std::vector<float> expected = at_vertices(refined(grid), function);
    REQUIRE(fine.size() == expected.size());
    for (std::size_t i = 0; i < fine.size(); ++i)
        CHECK(fine[i] == Approx(expected[i]).margin(1e-5));
}

TEST_CASE("of a dense ball the shell shows, neither what is around it nor what it hides",
          "[baked]") {
    const VertexGrid grid = cover({{-2.0, -2.0, -2.0}, {2.0, 2.0, 2.0}}, 32);
    const double density = 20.0;
    const std::vector<float> ball =
        at_vertices(grid, [&](const Eigen::Vector3d& p) { return p.norm() < 1.0 ? density : 0.0; });
    const std::vector<std::uint8_t> marks = significant_vertices(grid, ball, grid.spacing, 1e-2);
    for (std::int64_t i = 0; i < grid.size(); ++i) {
        const double radius = grid.position(i).norm();
        const bool marked = marks[static_cast<std::size_t>(i)] != 0;
        if (radius >= 1.0) CHECK_FALSE(marked);
        // A straight ray to here has 1e-2 of its light left at this depth, so everything above it
        // can show.
        const double visible_depth = std::log(1e2) / density;
        if (radius < 1.0 && radius > 1.0 - visible_depth + grid.spacing) CHECK(marked);
        if (radius < 1.0 - 2.0 * visible_depth - 2.0 * grid.spacing) CHECK_FALSE(marked);
    }
    const std::vector<std::int64_t> vertices = vertices_to_refine(grid, marks);
    CHECK(std::ranges::is_sorted(vertices));
    const VertexGrid fine = refined(grid);
    for (std::int64_t i = 0; i < grid.size(); ++i) {
        if (marks[static_cast<std::size_t>(i)] == 0) continue;
        const auto coordinates = grid.coordinates(i);
        for (const std::int64_t step : {-1, 0, 1})
            CHECK(std::ranges::binary_search(
                vertices, fine.index(2 * coordinates[0] + step, 2 * coordinates[1],
                                     2 * coordinates[2] - step)));
    }
}

TEST_CASE("a grid without density has nothing to refine", "[baked]") {
    const VertexGrid grid = cover({{-2.0, -2.0, -2.0}, {2.0, 2.0, 2.0}}, 4);
    const std::vector<float> nothing(static_cast<std::size_t>(grid.size()));
    const std::vector<std::uint8_t> marks = significant_vertices(grid, nothing, 1.0, 0.0);
    CHECK(vertices_to_refine(grid, marks).empty());
}

TEST_CASE("the principal plane holds vectors that lie in a plane, and has orthonormal directions",
          "[baked]") {
    Rng rng(1);
    constexpr std::int64_t rows = 200, channels = 12, rank = 3;
    const std::vector<double> generators = rng.normal({rank + 1, channels}, 0.0, 1.0).to_vector();
    Tensor features({rows, channels}), weights({rows});
    for (std::int64_t row = 0; row < rows; ++row) {
        const std::vector<double> share = rng.normal({rank}, 0.0, 1.0).to_vector();
        // The last tenth lies elsewhere and counts for nothing.
        const bool counts = row < rows * 9 / 10;
        weights.mutable_values<float>()[static_cast<std::size_t>(row)] =
            counts ? static_cast<float>(1 + row % 3) : 0.0F;
        for (std::int64_t c = 0; c < channels; ++c) {
            double value =
                counts ? generators[static_cast<std::size_t>(rank * channels + c)] : rng.normal();
            for (std::int64_t k = 0; k < rank; ++k)
                value += share[static_cast<std::size_t>(k)] *
                         generators[static_cast<std::size_t>(k * channels + c)];
            features.mutable_values<float>()[static_cast<std::size_t>(row * channels + c)] =
                static_cast<float>(value);
        }
    }
    const FeatureBasis basis = principal_plane(features, weights, rank);
    const std::vector<double> mean = basis.mean.to_vector(),
                              directions = basis.directions.to_vector();
    const auto entry = [&](std::int64_t k, std::int64_t c) {
        return directions[static_cast<std::size_t>(k * channels + c)];
    };
    for (std::int64_t a = 0; a < rank; ++a) {
        for (std::int64_t b = 0; b < rank; ++b) {
            double product = 0.0;
            for (std::int64_t c = 0; c < channels; ++c) product += entry(a, c) * entry(b, c);
            CHECK(product == Approx(a == b ? 1.0 : 0.0).margin(1e-5));
        }
    }
    const std::vector<double> values = features.to_vector();
    for (std::int64_t row = 0; row < rows * 9 / 10; ++row) {
        std::vector<double> rest(channels);
        for (std::size_t c = 0; c < rest.size(); ++c)
            rest[c] = values[static_cast<std::size_t>(row * channels) + c] - mean[c];
        for (std::int64_t k = 0; k < rank; ++k) {
            double part = 0.0;
            for (std::int64_t c = 0; c < channels; ++c)
                part += entry(k, c) * rest[static_cast<std::size_t>(c)];
            for (std::int64_t c = 0; c < channels; ++c)
                rest[static_cast<std::size_t>(c)] -= part * entry(k, c);
        }
        for (const double value : rest) CHECK(value == Approx(0.0).margin(1e-4));
    }
}
