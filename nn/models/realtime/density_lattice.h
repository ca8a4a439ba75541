#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/camera.h"

namespace stymo {

/// Vertices of a box of cubic cells, x fastest.
struct Lattice {
    Vector3 origin{};  ///< the first vertex, world coordinates
    double spacing = 1.0;
    std::array<std::int64_t, 3> vertices{1, 1, 1};

    [[nodiscard]] std::int64_t size() const { return vertices[0] * vertices[1] * vertices[2]; }
    [[nodiscard]] std::int64_t index(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return (z * vertices[1] + y) * vertices[0] + x;
    }
    [[nodiscard]] std::array<std::int64_t, 3> place(std::int64_t index) const {
        return {index % vertices[0], index / vertices[0] % vertices[1], index / (vertices[0] * vertices[1])};
    }
    [[nodiscard]] Vector3 position(std::int64_t index) const;
};

struct Box {
    Vector3 lower{};
    Vector3 upper{};
};

/// `cells` cells along the longest side of the box, which they cover.
[[nodiscard]] Lattice cover(const Box& box, std::int64_t cells);
/// Half the spacing; every vertex is one of the fine lattice too.
[[nodiscard]] Lattice refined(const Lattice& lattice);
/// Values at the vertices of refined(lattice), interpolated trilinearly.
[[nodiscard]] std::vector<float> prolonged(const Lattice& lattice, const std::vector<float>& values);

/// A byte for each vertex: 1 where a sample that stands for `length` of a ray from outside of the box may get a compositing
/// weight above `tolerance`. What hides behind density counts as hidden only if it does so along every path of lattice edges,
/// which is longer than a straight ray by a factor of sqrt(3) at most.
[[nodiscard]] std::vector<std::uint8_t> significant_vertices(const Lattice& lattice, const std::vector<float>& density,
                                                             double length, double tolerance);
/// Vertices of refined(lattice) in the cells that have a marked corner, in ascending order.
[[nodiscard]] std::vector<std::int64_t> vertices_to_refine(const Lattice& lattice, const std::vector<std::uint8_t>& marks);

}  // namespace stymo
