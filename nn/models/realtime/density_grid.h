#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "nn/engine/sample_selection.h"

namespace stymo {

/// Evaluates a field at any number of points, 3 coordinates each: the density is softplus(logit).
using LogitFunction = std::function<void(std::span<const float> points, std::span<float> logits)>;

/// The density of one head at the vertices of a grid around the origin, evaluated where points need
/// it and kept. What is known of a point depends on the head alone, not on earlier evaluations.
/// Vertices stand `spacing` apart, but twice that in cells of eight such cubes whose corners are
/// all thinner than `thin`. Bounds are the extremes over the eight corners around a point. They
/// hold where the density is monotonous between the corners, so not for smaller details. The
/// estimate interpolates the logits of the corners linearly.
class DensityGrid {
public:
    DensityGrid() = default;
    /// A cube around the origin whose half side is at least `half_side`.
    DensityGrid(double half_side, double spacing, double thin = 0.0);

    /// Of these points, 3 numbers each, one for each cell within the cube that some of them lie in.
    [[nodiscard]] std::vector<float> one_in_each_cell(std::span<const float> points) const;
    /// For another head.
    void forget();
    /// Evaluates the unknown vertices around these points, 3 coordinates each.
    void evaluate_around(std::span<const float> points, const LogitFunction& logits_at);
    /// From 0 to infinity outside the cube, and where nothing was evaluated. False if a point
    /// inside the cube lies at such a place.
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
    /// Evaluates the unknown vertices of these cells, `step` apart.
    void evaluate(std::span<const std::int64_t> cells, std::int64_t step,
                  const LogitFunction& logits_at);
    [[nodiscard]] bool is_thin(std::int64_t cell) const;

    std::int64_t cells_ = 0;     ///< along each axis, of two spacings
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
