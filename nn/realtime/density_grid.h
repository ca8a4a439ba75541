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
/// order of evaluations. The bounds at a point are the extremes over the eight vertices around it.
/// They hold where the density is monotonic between these, so they can miss smaller details. The
/// estimate interpolates the logits of the vertices trilinearly.
class DensityGrid {
public:
    DensityGrid() = default;
    /// A cube around the origin; half its side is `half_side` rounded up to a multiple of
    /// `spacing`.
    DensityGrid(double half_side, double spacing);

    /// Discards all evaluations, for another head.
    void forget();
    /// Evaluates the unknown vertices around these points, 3 coordinates each.
    void evaluate_around(std::span<const float> points, const LogitFunction& logits_at);
    /// Bounds at these points, 3 coordinates each. Outside the cube and between unknown vertices
    /// they are 0 and infinity. Returns false if a point lies between unknown vertices.
    bool bounds(std::span<const float> points, std::span<DensityBounds> result) const;
    /// The number of evaluated vertices.
    [[nodiscard]] std::int64_t known_vertices() const { return known_vertices_; }

private:
    struct Location;
    [[nodiscard]] Location locate(const float* point) const;
    /// Marks the vertices around these points that are not known, and notes them and their places.
    void want_around(std::span<const float> points);

    std::int64_t cells_ = 0;     ///< along each axis
    std::int64_t vertices_ = 0;  ///< along each axis
    float half_side_ = 0.0F;
    float spacing_ = 0.0F;
    std::vector<float> logits_;  ///< of all vertices
    std::int64_t known_vertices_ = 0;
    std::vector<std::int64_t> wanted_;
    std::vector<float> points_;
    std::vector<float> new_logits_;
};

}  // namespace stymo
