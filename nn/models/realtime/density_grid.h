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
/// of a point depends on the head alone, not on what was asked before. Vertices stand `spacing` apart, but twice that in cells of
/// eight such cubes whose corners are all thinner than `thin`. Bounds are the extremes over the eight corners around a point:
/// they hold where the density is monotonous between them, so not for what is smaller; the estimate is linear between the
/// corners in the number of which the density is the softplus.
class DensityGrid {
public:
    DensityGrid() = default;
    /// A cube around the origin whose half side is at least `half_side`.
    DensityGrid(double half_side, double spacing, double thin = 0.0);

    /// Of these points, 3 numbers each, one for each cell within the cube that some of them lie in.
    [[nodiscard]] std::vector<float> one_in_each_cell(std::span<const float> points) const;
    /// For another head.
    void forget();
    /// Asks for what is unknown around these points, 3 numbers each.
    void learn(std::span<const float> points, const DensityFunction& density);
    /// From 0 to infinity outside the cube, and where nothing was learnt. False if there is such a place inside.
    bool bounds(std::span<const float> points, std::span<DensityBounds> result) const;
    /// Whether all these points, 3 numbers each, lie in cells that are known and thin.
    [[nodiscard]] bool all_thin(std::span<const float> points) const;
    /// How many vertices are known.
    [[nodiscard]] std::int64_t known_vertices() const { return known_vertices_; }

private:
    enum class CellState : std::uint8_t { unknown, coarse, fine };
    struct Place;
    [[nodiscard]] Place place_of(const float* point) const;
    /// Negative outside the cube.
    [[nodiscard]] std::int64_t cell_of(const float* point) const;
    [[nodiscard]] std::int64_t first_vertex(std::int64_t cell) const;
    /// Vertices of these cells, `step` apart, as far as they are unknown.
    void ask(std::span<const std::int64_t> cells, std::int64_t step, const DensityFunction& density);
    [[nodiscard]] bool is_thin(std::int64_t cell) const;

    std::int64_t cells_ = 0;     ///< along each axis, of two spacings
    std::int64_t vertices_ = 0;  ///< along each axis, one spacing apart
    float half_side_ = 0.0F;
    float spacing_ = 0.0F;
    float thin_ = 0.0F;  ///< the softplus of it
    std::vector<CellState> states_;
    std::vector<float> inputs_;  ///< of all vertices: the density is the softplus
    std::int64_t known_vertices_ = 0;
    std::vector<std::int64_t> new_cells_;
    std::vector<std::int64_t> wanted_;
    std::vector<float> points_;
    std::vector<float> densities_;
};

}  // namespace stymo
