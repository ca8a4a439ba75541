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

}  // namespace stymo
