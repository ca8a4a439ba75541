#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "nn/models/realtime/sample_selection.h"
#include "render/camera.h"

namespace stymo {

/// Densities at any number of points, 3 numbers each.
using DensityFunction = std::function<void(std::span<const float> points, std::span<float> densities)>;

struct DensityGridOptions {
    Vector3 low{};  ///< corners of the region, which is widened to whole blocks
    Vector3 high{};
    double block_side = 0.25;
    float empty_density = 0.01F;  ///< what counts as nothing at the vertices of a block
};

/// The density of one head in blocks of 4 x 4 x 4 cells. The corners of all blocks are known; blocks with density at a vertex are
/// known by the vertices of their cells, and so is whatever touches that density, wherever it goes. Bounds are the extremes over
/// the corners of a cell, or of a block with nothing at its corners. They hold where the density is monotonous within the cell, so
/// not for what is thinner than a cell, nor for what lies between the corners of one block and apart from everything else.
class DensityGrid {
public:
    DensityGrid() = default;
    DensityGrid(const DensityGridOptions& options, const DensityFunction& density);

    /// Bounds at points, 3 numbers each; from 0 to infinity outside the region, where nothing is known.
    void bounds(std::span<const float> points, std::span<DensityBounds> result) const;
    /// How often the density was asked for.
    [[nodiscard]] std::int64_t evaluated_points() const { return evaluated_points_; }

private:
    static constexpr std::int64_t cells = 4;  ///< along a side of a block
    static constexpr std::int64_t vertices = cells + 1;
    using Block = std::array<float, static_cast<std::size_t>(vertices * vertices * vertices)>;
    struct Lattice;

    void refine_around(Lattice& lattice, const std::array<std::int64_t, 3>& place,
                       std::vector<std::array<std::int64_t, 3>>& refined);
    void store(const Lattice& lattice, const std::vector<std::array<std::int64_t, 3>>& refined);
    [[nodiscard]] DensityBounds at(const float* point) const;
    [[nodiscard]] std::int64_t block_number(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return (z * blocks_[1] + y) * blocks_[0] + x;
    }

    std::array<std::int64_t, 3> blocks_{};  ///< along each axis
    std::array<float, 3> low_{};
    float blocks_per_unit_ = 0.0F;
    std::vector<DensityBounds> coarse_;  ///< of each block
    std::vector<std::int32_t> fine_;     ///< where in `vertices_` each block is, or -1
    std::vector<Block> vertices_;
    std::int64_t evaluated_points_ = 0;
};

}  // namespace stymo
