#include "nn/realtime/vertex_grid.h"

#include <algorithm>
#include <cmath>

namespace stymo {

Eigen::Vector3d VertexGrid::position(std::int64_t index) const {
    const std::array<std::int64_t, 3> steps = coordinates(index);
    return origin + spacing * Eigen::Vector3<std::int64_t>(steps.data()).cast<double>();
}

VertexGrid cover(const Box& box, std::int64_t cells) {
    const Eigen::Vector3d sides = box.upper - box.lower;
    VertexGrid grid{box.lower, sides.maxCoeff() / static_cast<double>(cells), {}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double exact = sides[axis] / grid.spacing;
        grid.vertices[axis] =
            std::max<std::int64_t>(static_cast<std::int64_t>(std::ceil(exact - 1e-6)), 1) + 1;
    }
    return grid;
}

}  // namespace stymo
