#include "nn/models/realtime/density_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stymo {
namespace {

constexpr float unknown = -1.0F;
constexpr float wanted = -2.0F;

}  // namespace

/// All vertices of the region while the density is being found.
struct DensityGrid::Lattice {
    std::array<std::int64_t, 3> extent{};
    std::array<float, 3> low{};
    float spacing = 0.0F;
    std::vector<float> density;       ///< unknown, wanted, or what it is
    std::vector<std::int64_t> fresh;  ///< the vertices that were asked for last

    [[nodiscard]] std::int64_t number(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return (z * extent[1] + y) * extent[0] + x;
    }
    [[nodiscard]] std::array<std::int64_t, 3> place(std::int64_t number) const {
        return {number % extent[0], number / extent[0] % extent[1], number / extent[0] / extent[1]};
    }
    void want(std::int64_t x, std::int64_t y, std::int64_t z) {
        float& value = density[static_cast<std::size_t>(number(x, y, z))];
        if (value != unknown) return;
        value = wanted;
        fresh.push_back(number(x, y, z));
    }
    void evaluate(const DensityFunction& function) {
        std::vector<float> points;
        for (const std::int64_t index : fresh) {
            const auto position = place(index);
            for (std::size_t axis = 0; axis < 3; ++axis)
                points.push_back(low[axis] + spacing * static_cast<float>(position[axis]));
        }
        std::vector<float> densities(fresh.size());
        function(points, densities);
        for (std::size_t i = 0; i < fresh.size(); ++i) density[static_cast<std::size_t>(fresh[i])] = densities[i];
    }
};

DensityGrid::DensityGrid(const DensityGridOptions& options, const DensityFunction& density)
    : blocks_per_unit_(static_cast<float>(1.0 / options.block_side)) {
    Lattice lattice;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double extent = options.high[axis] - options.low[axis];
        blocks_[axis] = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(extent / options.block_side)));
        low_[axis] = static_cast<float>(options.low[axis]);
        lattice.extent[axis] = blocks_[axis] * cells + 1;
    }
    lattice.low = low_;
    lattice.spacing = static_cast<float>(options.block_side / static_cast<double>(cells));
    lattice.density.assign(static_cast<std::size_t>(lattice.extent[0] * lattice.extent[1] * lattice.extent[2]), unknown);
    fine_.assign(static_cast<std::size_t>(blocks_[0] * blocks_[1] * blocks_[2]), -1);

    for (std::int64_t z = 0; z <= blocks_[2]; ++z) {
        for (std::int64_t y = 0; y <= blocks_[1]; ++y) {
            for (std::int64_t x = 0; x <= blocks_[0]; ++x) lattice.want(x * cells, y * cells, z * cells);
        }
    }
    std::vector<std::array<std::int64_t, 3>> refined;
    while (!lattice.fresh.empty()) {
        lattice.evaluate(density);
        evaluated_points_ += static_cast<std::int64_t>(lattice.fresh.size());
        const std::vector<std::int64_t> seen = std::exchange(lattice.fresh, {});
        for (const std::int64_t number : seen) {
            if (!(lattice.density[static_cast<std::size_t>(number)] > options.empty_density)) continue;
            refine_around(lattice, lattice.place(number), refined);
        }
    }
    store(lattice, refined);
}

/// A vertex on a face belongs to the blocks on both sides of it.
void DensityGrid::refine_around(Lattice& lattice, const std::array<std::int64_t, 3>& place,
                                std::vector<std::array<std::int64_t, 3>>& refined) {
    std::array<std::int64_t, 3> first{}, last{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        first[axis] = std::max<std::int64_t>(0, (place[axis] + cells - 1) / cells - 1);
        last[axis] = std::min(blocks_[axis] - 1, place[axis] / cells);
    }
    for (std::int64_t z = first[2]; z <= last[2]; ++z) {
        for (std::int64_t y = first[1]; y <= last[1]; ++y) {
            for (std::int64_t x = first[0]; x <= last[0]; ++x) {
                std::int32_t& fine = fine_[static_cast<std::size_t>(block_number(x, y, z))];
                if (fine >= 0) continue;
                fine = static_cast<std::int32_t>(refined.size());
                refined.push_back({x, y, z});
                for (std::int64_t k = 0; k < vertices * vertices * vertices; ++k)
                    lattice.want(x * cells + k % vertices, y * cells + k / vertices % vertices, z * cells + k / vertices / vertices);
            }
        }
    }
}

void DensityGrid::store(const Lattice& lattice, const std::vector<std::array<std::int64_t, 3>>& refined) {
    const auto value = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        return lattice.density[static_cast<std::size_t>(lattice.number(x, y, z))];
    };
    for (const auto& [x, y, z] : refined) {
        Block& block = vertices_.emplace_back();
        for (std::int64_t k = 0; k < static_cast<std::int64_t>(block.size()); ++k) {
            block[static_cast<std::size_t>(k)] = value(x * cells + k % vertices, y * cells + k / vertices % vertices,
                                                       z * cells + k / vertices / vertices);
        }
    }
    coarse_.resize(fine_.size());
    for (std::int64_t z = 0; z < blocks_[2]; ++z) {
        for (std::int64_t y = 0; y < blocks_[1]; ++y) {
            for (std::int64_t x = 0; x < blocks_[0]; ++x) {
                DensityBounds bounds{std::numeric_limits<float>::infinity(), 0.0F, 0.0F};
                for (std::int64_t corner = 0; corner < 8; ++corner) {
                    const float density = value((x + corner % 2) * cells, (y + corner / 2 % 2) * cells, (z + corner / 4) * cells);
                    bounds.lower = std::min(bounds.lower, density);
                    bounds.upper = std::max(bounds.upper, density);
                    bounds.estimate += 0.125F * density;
                }
                coarse_[static_cast<std::size_t>(block_number(x, y, z))] = bounds;
            }
        }
    }
}

DensityBounds DensityGrid::at(const float* point) const {
    std::array<std::int64_t, 3> block{}, cell{};
    std::array<float, 3> part{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float position = (point[axis] - low_[axis]) * blocks_per_unit_;
        if (!(position >= 0.0F && position < static_cast<float>(blocks_[axis])))
            return {0.0F, 0.0F, std::numeric_limits<float>::infinity()};
        block[axis] = static_cast<std::int64_t>(position);
        const float within = (position - static_cast<float>(block[axis])) * static_cast<float>(cells);
        cell[axis] = static_cast<std::int64_t>(within);
        part[axis] = within - static_cast<float>(cell[axis]);
    }
    const auto number = static_cast<std::size_t>(block_number(block[0], block[1], block[2]));
    if (fine_[number] < 0) return coarse_[number];
    const float* corner = vertices_[static_cast<std::size_t>(fine_[number])].data() +
                          (cell[2] * vertices + cell[1]) * vertices + cell[0];
    DensityBounds result{corner[0], 0.0F, corner[0]};
    for (std::int64_t z = 0; z < 2; ++z) {
        for (std::int64_t y = 0; y < 2; ++y) {
            const float* edge = corner + (z * vertices + y) * vertices;
            result.lower = std::min({result.lower, edge[0], edge[1]});
            result.upper = std::max({result.upper, edge[0], edge[1]});
            const float share = (z == 1 ? part[2] : 1.0F - part[2]) * (y == 1 ? part[1] : 1.0F - part[1]);
            result.estimate += share * (edge[0] + part[0] * (edge[1] - edge[0]));
        }
    }
    return result;
}

void DensityGrid::bounds(std::span<const float> points, std::span<DensityBounds> result) const {
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = at(points.data() + 3 * i);
}

}  // namespace stymo
