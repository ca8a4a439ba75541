#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "nn/models/realtime/sample_selection.h"

namespace stymo {

/// Densities at any number of points, 3 numbers each.
using DensityFunction = std::function<void(std::span<const float> points, std::span<float> densities)>;

/// The density of one head at the vertices of a lattice around the origin, asked for as points need it and kept. What is known
/// of a point depends on the head alone, not on what was asked before. Bounds are the extremes over the eight corners of a cell:
/// they hold where the density is monotonous within the cell, so not for what is thinner than a cell; the estimate is linear
/// between the corners.
class DensityGrid {
public:
    DensityGrid() = default;
    /// A cube from -half_side to half_side along each axis.
    DensityGrid(double half_side, double spacing);

    /// For another head.
    void forget();
    /// Asks for the corners of the cells of these points, 3 numbers each, as far as they are unknown.
    void learn(std::span<const float> points, const DensityFunction& density);
    /// From 0 to infinity outside the cube, and where the corners are unknown. False if there is such a corner.
    bool bounds(std::span<const float> points, std::span<DensityBounds> result) const;
    /// How many vertices are known.
    [[nodiscard]] std::int64_t known_vertices() const { return known_vertices_; }

private:
    struct Cell;
    [[nodiscard]] Cell cell_of(const float* point) const;

    std::int64_t vertices_ = 0;  ///< along each axis
    float half_side_ = 0.0F;
    float spacing_ = 0.0F;
    std::vector<float> density_;  ///< of all vertices; negative: unknown
    std::int64_t known_vertices_ = 0;
    std::vector<std::int64_t> wanted_;
    std::vector<float> points_;
    std::vector<float> densities_;
};

}  // namespace stymo
