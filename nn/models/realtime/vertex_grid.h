#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/camera.h"

namespace stymo {

/// Vertices of a box of cubic cells, x fastest.
struct VertexGrid {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< the first vertex, world coordinates
    double spacing = 1.0;
    std::array<std::int64_t, 3> vertices{1, 1, 1};

    [[nodiscard]] std::int64_t size() const { return vertices[0] * vertices[1] * vertices[2]; }
    [[nodiscard]] std::int64_t index(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return (z * vertices[1] + y) * vertices[0] + x;
    }
    [[nodiscard]] std::array<std::int64_t, 3> place(std::int64_t index) const {
        return {index % vertices[0], index / vertices[0] % vertices[1],
                index / (vertices[0] * vertices[1])};
    }
    [[nodiscard]] Eigen::Vector3d position(std::int64_t index) const;
};

struct Box {
    Eigen::Vector3d lower = Eigen::Vector3d::Zero();
    Eigen::Vector3d upper = Eigen::Vector3d::Zero();
};

/// `cells` cells along the longest side of the box, which they cover.
[[nodiscard]] VertexGrid cover(const Box& box, std::int64_t cells);
/// Half the spacing; every vertex is one of the fine grid too.
[[nodiscard]] VertexGrid refined(const VertexGrid& grid);
/// Values at the vertices of refined(grid), interpolated trilinearly.
[[nodiscard]] std::vector<float> prolonged(const VertexGrid& grid,
                                           const std::vector<float>& values);

/// A byte for each vertex: 1 where a sample that stands for `length` of a ray from outside of the
/// box may get a compositing weight above `tolerance`. What hides behind density counts as hidden
/// only if it does so along every path of grid edges, which is longer than a straight ray by a
/// factor of sqrt(3) at most.
[[nodiscard]] std::vector<std::uint8_t> significant_vertices(const VertexGrid& grid,
                                                             const std::vector<float>& density,
                                                             double length, double tolerance);
/// Vertices of refined(grid) in the cells that have a marked corner, in ascending order.
[[nodiscard]] std::vector<std::int64_t> vertices_to_refine(const VertexGrid& grid,
                                                           const std::vector<std::uint8_t>& marks);

}  // namespace stymo
