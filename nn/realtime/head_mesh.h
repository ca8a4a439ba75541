#pragma once

#include <array>
#include <cstdint>

#include "nn/models/model.h"
#include "render/triangle_mesh.h"

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

struct HeadMeshOptions {
    std::int64_t resolution = 128;  ///< cells along the longest side of the box around the head
    double level = 2.0;  ///< density at the surface, per unit of length; at 2, a third of a unit
                         ///< absorbs half of the light
};

/// The isosurface of the density at `options.level` for row `index` of codes in Z, in world
/// coordinates. It is closed, and only its largest connected piece is kept. The search covers the
/// volume that the model's frontal camera sees from the near plane to the back of a head. Training
/// constrains no surface that photos do not show, so the back of the head is arbitrary. Throws
/// ValueError if no density reaches the level, or for a resolution below 2.
[[nodiscard]] TriangleMesh head_mesh(const Model& model, const Codes& codes, std::int64_t index,
                                     const HeadMeshOptions& options);

}  // namespace stymo
