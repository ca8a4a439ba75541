#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/camera.h"

namespace stymo {

/// The vertices of a box of cubic cells. x varies fastest in memory.
struct VertexGrid {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< the first vertex, world coordinates
    double spacing = 1.0;
    std::array<std::int64_t, 3> vertices{1, 1, 1};

    [[nodiscard]] std::int64_t size() const { return vertices[0] * vertices[1] * vertices[2]; }
    [[nodiscard]] std::int64_t index(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return (z * vertices[1] + y) * vertices[0] + x;
    }
    [[nodiscard]] std::array<std::int64_t, 3> coordinates(std::int64_t index) const {
        return {index % vertices[0], index / vertices[0] % vertices[1],
                index / (vertices[0] * vertices[1])};
    }
    [[nodiscard]] Eigen::Vector3d position(std::int64_t index) const;
};

struct Box {
    Eigen::Vector3d lower = Eigen::Vector3d::Zero();
    Eigen::Vector3d upper = Eigen::Vector3d::Zero();
};

/// A grid that covers the box, with `cells` cells along its longest side.
[[nodiscard]] VertexGrid cover(const Box& box, std::int64_t cells);
/// The grid of half the spacing, which contains every vertex of `grid`.
[[nodiscard]] VertexGrid refined(const VertexGrid& grid);
/// Values at the vertices of refined(grid), interpolated trilinearly.
[[nodiscard]] std::vector<float> prolonged(const VertexGrid& grid,
                                           const std::vector<float>& values);

/// A byte for each vertex: 1 where a sample with an interval of length `length`, on a ray from
/// outside the box, may have a compositing weight above `tolerance`. The transmittance towards a
/// vertex is bounded by the smallest optical depth of all paths of grid edges from outside, divided
/// by sqrt(3), since such a path is at most sqrt(3) times as long as a straight ray.
[[nodiscard]] std::vector<std::uint8_t> significant_vertices(const VertexGrid& grid,
                                                             const std::vector<float>& density,
                                                             double length, double tolerance);
/// Vertices of refined(grid) in the cells that have a marked corner, in ascending order.
[[nodiscard]] std::vector<std::int64_t> vertices_to_refine(const VertexGrid& grid,
                                                           const std::vector<std::uint8_t>& marks);

}  // namespace stymo
