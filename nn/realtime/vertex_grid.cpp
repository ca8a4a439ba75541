#include "nn/realtime/vertex_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/parallel.h"

namespace stymo {
namespace {

constexpr std::int64_t slices_per_chunk = 4;

using Steps = std::array<std::int64_t, 3>;

Steps strides(const VertexGrid& grid) {
    return {1, grid.vertices[0], grid.vertices[0] * grid.vertices[1]};
}

/// For each vertex the smallest optical depth of a path of edges from outside the box, by eight
/// sweeps of the fast sweeping method (Zhao 2005), one for each octant.
std::vector<float> least_optical_depth(const VertexGrid& grid, const std::vector<float>& density) {
    std::vector<float> least(density.size(), std::numeric_limits<float>::max());
    const Steps stride = strides(grid);
    const auto half_edge = static_cast<float>(0.5 * grid.spacing);
    for (int octant = 0; octant < 8; ++octant) {
        const auto along = [&](std::size_t axis, std::int64_t step) {
            return ((octant >> axis) & 1) == 0 ? step : grid.vertices[axis] - 1 - step;
        };
        const auto upwind = [&](std::size_t axis) {
            return ((octant >> axis) & 1) == 0 ? -stride[axis] : stride[axis];
        };
        const Steps back{upwind(0), upwind(1), upwind(2)};
        for (std::int64_t z = 0; z < grid.vertices[2]; ++z) {
            for (std::int64_t y = 0; y < grid.vertices[1]; ++y) {
                for (std::int64_t x = 0; x < grid.vertices[0]; ++x) {
                    const auto vertex =
                        static_cast<std::size_t>(grid.index(along(0, x), along(1, y), along(2, z)));
                    const auto from = [&](std::size_t axis, std::int64_t step) {
                        if (step == 0) return 0.0F;
                        const auto neighbour = static_cast<std::size_t>(
                            static_cast<std::int64_t>(vertex) + back[axis]);
                        return least[neighbour] +
                               half_edge * (density[neighbour] + density[vertex]);
                    };
                    least[vertex] = std::min({least[vertex], from(0, x), from(1, y), from(2, z)});
                }
            }
        }
    }
    return least;
}

/// Calls visit(x, y, z) for the lower corner of each cell with a marked corner.
template <class Visit>
void for_each_marked_cell(const VertexGrid& grid, const std::vector<std::uint8_t>& marks,
                          Visit visit) {
    const Steps stride = strides(grid);
    for (std::int64_t z = 0; z + 1 < grid.vertices[2]; ++z) {
        for (std::int64_t y = 0; y + 1 < grid.vertices[1]; ++y) {
            for (std::int64_t x = 0; x + 1 < grid.vertices[0]; ++x) {
                const std::uint8_t* corner = marks.data() + grid.index(x, y, z);
                const auto edge = [&](const std::uint8_t* first) { return first[0] | first[1]; };
                if ((edge(corner) | edge(corner + stride[1]) | edge(corner + stride[2]) |
                     edge(corner + stride[1] + stride[2])) != 0) {
                    visit(x, y, z);
                }
            }
        }
    }
}

}  // namespace

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

VertexGrid refined(const VertexGrid& grid) {
    VertexGrid fine{grid.origin, 0.5 * grid.spacing, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) fine.vertices[axis] = 2 * grid.vertices[axis] - 1;
    return fine;
}

std::vector<float> prolonged(const VertexGrid& grid, const std::vector<float>& values) {
    const VertexGrid fine = refined(grid);
    const Steps stride = strides(grid);
    std::vector<float> result(static_cast<std::size_t>(fine.size()));
    parallel_for(fine.vertices[2], slices_per_chunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t z = begin; z < end; ++z) {
            for (std::int64_t y = 0; y < fine.vertices[1]; ++y) {
                const std::int64_t up = (z & 1) * stride[2], down = (y & 1) * stride[1];
                const float* row = values.data() + grid.index(0, y / 2, z / 2);
                float* out = result.data() + fine.index(0, y, z);
                const auto middle = [&](std::int64_t x) {
                    return 0.25F * (row[x] + row[x + up] + row[x + down] + row[x + up + down]);
                };
                for (std::int64_t x = 0; x < fine.vertices[0]; ++x)
                    out[x] = 0.5F * (middle(x / 2) + middle((x + 1) / 2));
            }
        }
    });
    return result;
}

std::vector<std::uint8_t> significant_vertices(const VertexGrid& grid,
                                               const std::vector<float>& density, double length,
                                               double tolerance) {
    const std::vector<float> hidden_by = least_optical_depth(grid, density);
    std::vector<std::uint8_t> marks(density.size());
    for (std::size_t i = 0; i < marks.size(); ++i) {
        const double transmittance =
            std::exp(-static_cast<double>(hidden_by[i]) / std::numbers::sqrt3);
        marks[i] =
            transmittance * -std::expm1(-length * static_cast<double>(density[i])) > tolerance ? 1
                                                                                               : 0;
    }
    return marks;
}

std::vector<std::int64_t> vertices_to_refine(const VertexGrid& grid,
                                             const std::vector<std::uint8_t>& marks) {
    const VertexGrid fine = refined(grid);
    std::vector<std::uint8_t> wanted(static_cast<std::size_t>(fine.size()));
    for_each_marked_cell(grid, marks, [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        for (std::int64_t dz = 0; dz < 3; ++dz) {
            for (std::int64_t dy = 0; dy < 3; ++dy)
                std::fill_n(wanted.begin() + fine.index(2 * x, 2 * y + dy, 2 * z + dz), 3,
                            std::uint8_t{1});
        }
    });
    std::vector<std::int64_t> indices;
    for (std::int64_t i = 0; i < fine.size(); ++i) {
        if (wanted[static_cast<std::size_t>(i)] != 0) indices.push_back(i);
    }
    return indices;
}

}  // namespace stymo
