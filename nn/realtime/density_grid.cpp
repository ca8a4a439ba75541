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
// Two levels save evaluations. A cell is first evaluated at its eight corners, two spacings apart.
// If all of them are below `thin`, it stays coarse, as most of space does. Otherwise all 27
// vertices are evaluated. A structure that lies between the corners may exceed their bounds, so the
// error of a tolerance is measured, not guaranteed (docs/studies/rendering.md). A coarser grid has
// looser bounds and keeps more samples for the same error; a finer one loses quality.
//
// The cells of the usual views are evaluated when a head is first shown, the others when a view
// needs them (sampled_field.cpp). A vertex belongs to the grid, not to a cell: neighbours share its
// value. Bounds therefore do not depend on the order of evaluations, nor on the view that asked for
// them.

#include "nn/realtime/density_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "nn/engine/softplus.h"

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

/// The cell of a point, the first of the eight vertices around it, the step to the others, and the
/// position of the point between them.
struct DensityGrid::Location {
    std::int64_t cell = -1;  ///< outside the cube
    std::int64_t corner = 0;
    std::int64_t step = 2;
    std::array<float, 3> part{};
};

DensityGrid::DensityGrid(double half_side, double spacing, double thin)
    : cells_(static_cast<std::int64_t>(std::ceil(half_side / spacing))),
      vertices_(2 * cells_ + 1),
      half_side_(static_cast<float>(static_cast<double>(cells_) * spacing)),
      spacing_(static_cast<float>(spacing)),
      thin_logit_(inverse_softplus(static_cast<float>(thin))),
      states_(static_cast<std::size_t>(cells_ * cells_ * cells_), CellState::unknown),
      logits_(static_cast<std::size_t>(vertices_ * vertices_ * vertices_), unknown) {}

std::vector<float> DensityGrid::one_in_each_cell(std::span<const float> points) const {
    std::vector<bool> taken(states_.size());
    std::vector<float> result;
    for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
        const std::int64_t cell = locate(points.data() + i).cell;
        if (cell < 0 || taken[static_cast<std::size_t>(cell)]) continue;
        taken[static_cast<std::size_t>(cell)] = true;
        result.insert(result.end(), points.begin() + static_cast<std::ptrdiff_t>(i),
                      points.begin() + static_cast<std::ptrdiff_t>(i + 3));
    }
    return result;
}

void DensityGrid::forget() {
    std::ranges::fill(states_, CellState::unknown);
    std::ranges::fill(logits_, unknown);
    known_vertices_ = 0;
}

std::int64_t DensityGrid::first_vertex(std::int64_t cell) const {
    return 2 * ((cell / cells_ / cells_ * vertices_ + cell / cells_ % cells_) * vertices_ +
                cell % cells_);
}

DensityGrid::Location DensityGrid::locate(const float* point) const {
    Location location;
    std::array<std::int64_t, 3> index{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float position = (point[axis] + half_side_) / (2.0F * spacing_);
        if (!(position >= 0.0F && position < static_cast<float>(cells_))) return location;
        index[axis] = static_cast<std::int64_t>(position);
        location.part[axis] = position - static_cast<float>(index[axis]);
    }
    location.cell = (index[2] * cells_ + index[1]) * cells_ + index[0];
    const bool fine = states_[static_cast<std::size_t>(location.cell)] == CellState::fine;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        index[axis] *= 2;
        if (!fine) continue;
        const bool second = location.part[axis] >= 0.5F;
        index[axis] += second ? 1 : 0;
        location.part[axis] = 2.0F * location.part[axis] - (second ? 1.0F : 0.0F);
    }
    location.corner = (index[2] * vertices_ + index[1]) * vertices_ + index[0];
    location.step = fine ? 1 : 2;
    return location;
}

std::int64_t DensityGrid::cell_of(const float* point) const {
    const float cells_per_unit = 1.0F / (2.0F * spacing_);
    std::int64_t cell = 0;
    for (std::size_t axis = 3; axis-- > 0;) {
        const float position = (point[axis] + half_side_) * cells_per_unit;
        if (!(position >= 0.0F && position < static_cast<float>(cells_))) return -1;
        cell = cell * cells_ + static_cast<std::int64_t>(position);
    }
    return cell;
}

bool DensityGrid::all_thin(std::span<const float> points) const {
    for (std::size_t i = 0; i < points.size(); i += 3) {
        const std::int64_t cell = cell_of(points.data() + i);
        if (cell < 0 || states_[static_cast<std::size_t>(cell)] != CellState::coarse) return false;
    }
    return true;
}

void DensityGrid::evaluate(std::span<const std::int64_t> cells, std::int64_t step,
                           const LogitFunction& logits_at) {
    wanted_.clear();
    points_.clear();
    const auto want = [this](std::int64_t vertex) {
        float& logit = logits_[static_cast<std::size_t>(vertex)];
        if (logit != unknown) return;
        logit = wanted;
        wanted_.push_back(vertex);
        for (const std::int64_t coordinate :
             {vertex % vertices_, vertex / vertices_ % vertices_, vertex / vertices_ / vertices_})
            points_.push_back(static_cast<float>(coordinate) * spacing_ - half_side_);
    };
    for (const std::int64_t cell : cells) {
        const std::int64_t first = first_vertex(cell);
        for (std::int64_t z = 0; z <= 2; z += step) {
            for (std::int64_t y = 0; y <= 2; y += step) {
                for (std::int64_t x = 0; x <= 2; x += step)
                    want(first + (z * vertices_ + y) * vertices_ + x);
            }
        }
    }
    new_logits_.resize(wanted_.size());
    logits_at(points_, new_logits_);
    // A lower bound keeps logits apart from the special values `unknown` and `wanted`.
    constexpr float least_logit = -60.0F;
    for (std::size_t i = 0; i < wanted_.size(); ++i)
        logits_[static_cast<std::size_t>(wanted_[i])] = std::max(new_logits_[i], least_logit);
    known_vertices_ += std::ssize(wanted_);
}

bool DensityGrid::is_thin(std::int64_t cell) const {
    const float* first = logits_.data() + first_vertex(cell);
    for (std::int64_t corner = 0; corner < 8; ++corner) {
        const std::int64_t x = corner % 2, y = corner / 2 % 2, z = corner / 4;
        if (first[2 * ((z * vertices_ + y) * vertices_ + x)] >= thin_logit_) return false;
    }
    return true;
}

void DensityGrid::evaluate_around(std::span<const float> points, const LogitFunction& logits_at) {
    new_cells_.clear();
    for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
        const std::int64_t cell = locate(points.data() + i).cell;
        if (cell < 0 || states_[static_cast<std::size_t>(cell)] != CellState::unknown) continue;
        states_[static_cast<std::size_t>(cell)] = CellState::coarse;
        new_cells_.push_back(cell);
    }
    evaluate(new_cells_, 2, logits_at);
    std::erase_if(new_cells_, [this](std::int64_t cell) { return is_thin(cell); });
    for (const std::int64_t cell : new_cells_)
        states_[static_cast<std::size_t>(cell)] = CellState::fine;
    evaluate(new_cells_, 1, logits_at);
}

bool DensityGrid::bounds(std::span<const float> points, std::span<DensityBounds> result) const {
    bool all_known = true;
    for (std::size_t i = 0; i < result.size(); ++i) {
        const Location location = locate(points.data() + 3 * i);
        const bool inside = location.cell >= 0;
        if (!inside || states_[static_cast<std::size_t>(location.cell)] == CellState::unknown) {
            result[i] = anything;
            all_known = all_known && !inside;
            continue;
        }
        const float* corner = logits_.data() + location.corner;
        float lower = *corner, upper = *corner, estimate = 0.0F;
        for (std::int64_t z = 0; z < 2; ++z) {
            for (std::int64_t y = 0; y < 2; ++y) {
                const float* row = corner + location.step * (z * vertices_ + y) * vertices_;
                const float first = row[0], second = row[location.step];
                lower = std::min({lower, first, second});
                upper = std::max({upper, first, second});
                const float share = (z == 1 ? location.part[2] : 1.0F - location.part[2]) *
                                    (y == 1 ? location.part[1] : 1.0F - location.part[1]);
                estimate += share * (first + location.part[0] * (second - first));
            }
        }
        result[i] = bounds_of_logits(lower, estimate, upper);
    }
    return all_known;
}

}  // namespace stymo
