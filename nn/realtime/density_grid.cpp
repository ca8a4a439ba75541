// Bounds of the density without evaluating the field.
//
// The selection of samples needs to know where a head may be before the field is evaluated. The
// density does not depend on the camera, so it is tabulated once for each head and serves all
// views.
//
// The table holds logits at the vertices of a regular grid. In the cell around a point, the
// smallest and the largest of the eight corners serve as bounds, and their trilinear interpolation
// as the estimate. A grid of booleans (occupied or not) would be smaller. But the selection needs
// both bounds: the upper one says that a sample may matter, and the lower one that what is in front
// hides it. The estimate gives the optical depth of samples that are left out. Logits are
// interpolated rather than densities: they are the output of the network, of which the density is
// an exponential where it is low. Softplus is monotonic, so bounds of logits are bounds of
// densities.
//
// A structure that lies between the vertices may exceed the bounds of its cell, so the error of a
// tolerance is measured, not guaranteed. A finer grid has tighter bounds and keeps fewer samples
// for the same error, but costs more evaluations of each new head. A grid that was coarse where its
// corners are thin missed strands of hair, which changed pixels by more than half.
//
// Vertices are evaluated when the first view needs them. A vertex belongs to the grid, not to a
// cell: neighbours share its value. Bounds therefore do not depend on the order of evaluations, nor
// on the view that asked for them.

#include "nn/realtime/density_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "nn/engine/compositing.h"

namespace stymo {
namespace {

constexpr float unknown = -1e3F;
constexpr float wanted = -2e3F;
constexpr DensityBounds anything{0.0F, 0.0F, std::numeric_limits<float>::infinity()};

/// Most of space is empty. Looser bounds are good enough there and faster to compute.
DensityBounds bounds_of_logits(float lower, float estimate, float upper) {
    constexpr float nothing = -16.0F, thin = -7.0F;
    constexpr DensityBounds next_to_nothing{0.0F, 0.0F, 1.2e-7F};  // softplus(-16) = 1.1e-7
    if (upper < nothing) return next_to_nothing;
    if (upper < thin) return {0.0F, std::exp(estimate), std::exp(upper)};
    return {softplus(lower), softplus(estimate), softplus(upper)};
}

}  // namespace

/// The first of the eight vertices around a point, and the position of the point between them.
struct DensityGrid::Location {
    std::int64_t corner = -1;  ///< outside the cube
    std::array<float, 3> part{};
};

DensityGrid::DensityGrid(double half_side, double spacing)
    : cells_(2 * static_cast<std::int64_t>(std::ceil(half_side / spacing))),
      vertices_(cells_ + 1),
      half_side_(static_cast<float>(0.5 * static_cast<double>(cells_) * spacing)),
      spacing_(static_cast<float>(spacing)),
      logits_(static_cast<std::size_t>(vertices_ * vertices_ * vertices_), unknown) {}

void DensityGrid::forget() {
    std::ranges::fill(logits_, unknown);
    known_vertices_ = 0;
}

DensityGrid::Location DensityGrid::locate(const float* point) const {
    Location location;
    std::array<std::int64_t, 3> index{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float position = (point[axis] + half_side_) / spacing_;
        if (!(position >= 0.0F && position < static_cast<float>(cells_))) return location;
        index[axis] = static_cast<std::int64_t>(position);
        location.part[axis] = position - static_cast<float>(index[axis]);
    }
    location.corner = (index[2] * vertices_ + index[1]) * vertices_ + index[0];
    return location;
}

void DensityGrid::evaluate_around(std::span<const float> points, const LogitFunction& logits_at) {
    wanted_.clear();
    points_.clear();
    try {
        want_around(points);
        new_logits_.resize(wanted_.size());
        logits_at(points_, new_logits_);
        if (std::ranges::any_of(new_logits_, [](float logit) { return std::isnan(logit); }))
            fail<NumericError>("the density of the face is not finite");
    } catch (...) {
        for (const std::int64_t vertex : wanted_)
            logits_[static_cast<std::size_t>(vertex)] = unknown;
        throw;
    }
    // Bounds keep logits apart from the special values `unknown` and `wanted`, and from infinity.
    constexpr float least_logit = -60.0F, largest_logit = 1e6F;
    for (std::size_t i = 0; i < wanted_.size(); ++i)
        logits_[static_cast<std::size_t>(wanted_[i])] =
            std::clamp(new_logits_[i], least_logit, largest_logit);
    known_vertices_ += std::ssize(wanted_);
}

void DensityGrid::want_around(std::span<const float> points) {
    const auto want = [this](std::int64_t vertex) {
        float& logit = logits_[static_cast<std::size_t>(vertex)];
        if (logit != unknown) return;
        wanted_.push_back(vertex);
        logit = wanted;
        for (const std::int64_t coordinate :
             {vertex % vertices_, vertex / vertices_ % vertices_, vertex / vertices_ / vertices_})
            points_.push_back(static_cast<float>(coordinate) * spacing_ - half_side_);
    };
    for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
        const std::int64_t first = locate(points.data() + i).corner;
        if (first < 0) continue;
        for (std::int64_t corner = 0; corner < 8; ++corner)
            want(first + ((corner / 4) * vertices_ + corner / 2 % 2) * vertices_ + corner % 2);
    }
}

bool DensityGrid::bounds(std::span<const float> points, std::span<DensityBounds> result) const {
    bool all_known = true;
    for (std::size_t i = 0; i < result.size(); ++i) {
        const Location location = locate(points.data() + 3 * i);
        result[i] = anything;
        if (location.corner < 0) continue;
        const float* corner = logits_.data() + location.corner;
        float lower = *corner, upper = *corner, estimate = 0.0F;
        for (std::int64_t z = 0; z < 2; ++z) {
            for (std::int64_t y = 0; y < 2; ++y) {
                const float* row = corner + (z * vertices_ + y) * vertices_;
                const float first = row[0], second = row[1];
                lower = std::min({lower, first, second});
                upper = std::max({upper, first, second});
                const float share = (z == 1 ? location.part[2] : 1.0F - location.part[2]) *
                                    (y == 1 ? location.part[1] : 1.0F - location.part[1]);
                estimate += share * (first + location.part[0] * (second - first));
            }
        }
        if (lower == unknown) {
            all_known = false;
        } else {
            result[i] = bounds_of_logits(lower, estimate, upper);
        }
    }
    return all_known;
}

}  // namespace stymo
