#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "nn/engine/sample_selection.h"

namespace stymo {

/// Evaluates a field at any number of points, 3 coordinates each. The density is softplus(logit).
using LogitFunction = std::function<void(std::span<const float> points, std::span<float> logits)>;

/// The density of one head at the vertices of a grid around the origin. Vertices are evaluated when
/// points need them, and kept. Bounds and estimate at a point depend only on the head, not on the
/// order of evaluations. The distance of vertices is `spacing`, but twice that in cells (two
/// spacings wide) whose corners all have a density below `thin`. The bounds at a point are the
/// extremes over the eight corners around it. They hold where the density is monotonic between the
/// corners, so they can miss smaller details. The estimate interpolates the logits of the corners
/// trilinearly.
class DensityGrid {
public:
    DensityGrid() = default;
    /// A cube around the origin; half its side is `half_side` rounded up to a multiple of
    /// `spacing`.
    DensityGrid(double half_side, double spacing, double thin = 0.0);

    /// A subset of these points, 3 coordinates each: the first one in each cell of the cube that
    /// contains any.
    [[nodiscard]] std::vector<float> one_in_each_cell(std::span<const float> points) const;
    /// Discards all evaluations, for another head.
    void forget();
    /// Evaluates the unknown vertices around these points, 3 coordinates each.
    void evaluate_around(std::span<const float> points, const LogitFunction& logits_at);
    /// Bounds at these points, 3 coordinates each. Outside the cube and in cells that were not
    /// evaluated they are 0 and infinity. Returns false if a point lies in such a cell.
    bool bounds(std::span<const float> points, std::span<DensityBounds> result) const;
    /// Whether all these points, 3 coordinates each, lie in evaluated cells whose corners are all
    /// below `thin`.
    [[nodiscard]] bool all_thin(std::span<const float> points) const;
    /// The number of evaluated vertices.
    [[nodiscard]] std::int64_t known_vertices() const { return known_vertices_; }

private:
    enum class CellState : std::uint8_t { unknown, coarse, fine };
    struct Location;
    [[nodiscard]] Location locate(const float* point) const;
    /// The cell of a point, negative outside the cube.
    [[nodiscard]] std::int64_t cell_of(const float* point) const;
    [[nodiscard]] std::int64_t first_vertex(std::int64_t cell) const;
    /// Evaluates the unknown vertices of these cells whose distance is `step` spacings.
    void evaluate(std::span<const std::int64_t> cells, std::int64_t step,
                  const LogitFunction& logits_at);
    [[nodiscard]] bool is_thin(std::int64_t cell) const;

    std::int64_t cells_ = 0;     ///< along each axis; each is two spacings wide
    std::int64_t vertices_ = 0;  ///< along each axis, one spacing apart
    float half_side_ = 0.0F;
    float spacing_ = 0.0F;
    float thin_logit_ = 0.0F;
    std::vector<CellState> states_;
    std::vector<float> logits_;  ///< of all vertices
    std::int64_t known_vertices_ = 0;
    std::vector<std::int64_t> new_cells_;
    std::vector<std::int64_t> wanted_;
    std::vector<float> points_;
    std::vector<float> new_logits_;
};

}  // namespace stymo
