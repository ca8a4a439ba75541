#include "nn/models/realtime/density_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace stymo {
namespace {

constexpr float unknown = -1.0F;
constexpr float wanted = -2.0F;
constexpr DensityBounds anything{0.0F, 0.0F, std::numeric_limits<float>::infinity()};

}  // namespace

/// The first corner of a cell, or -1 outside the cube, and where in it a point is.
struct DensityGrid::Cell {
    std::int64_t corner = -1;
    std::array<float, 3> part{};
};

DensityGrid::DensityGrid(double half_side, double spacing)
    : vertices_(static_cast<std::int64_t>(std::ceil(2.0 * half_side / spacing)) + 1),
      half_side_(static_cast<float>(half_side)),
      spacing_(static_cast<float>(spacing)),
      density_(static_cast<std::size_t>(vertices_ * vertices_ * vertices_), unknown) {}

void DensityGrid::forget() {
    std::ranges::fill(density_, unknown);
    known_vertices_ = 0;
}

DensityGrid::Cell DensityGrid::cell_of(const float* point) const {
    Cell cell;
    std::array<std::int64_t, 3> place{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float position = (point[axis] + half_side_) / spacing_;
        if (!(position >= 0.0F && position < static_cast<float>(vertices_ - 1))) return cell;
        place[axis] = static_cast<std::int64_t>(position);
        cell.part[axis] = position - static_cast<float>(place[axis]);
    }
    cell.corner = (place[2] * vertices_ + place[1]) * vertices_ + place[0];
    return cell;
}

void DensityGrid::learn(std::span<const float> points, const DensityFunction& density) {
    wanted_.clear();
    points_.clear();
    for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
        const Cell cell = cell_of(points.data() + i);
        for (std::int64_t k = 0; cell.corner >= 0 && k < 8; ++k) {
            const std::int64_t vertex = cell.corner + k % 2 + k / 2 % 2 * vertices_ + k / 4 * vertices_ * vertices_;
            float& value = density_[static_cast<std::size_t>(vertex)];
            if (value != unknown) continue;
            value = wanted;
            wanted_.push_back(vertex);
            for (const std::int64_t place : {vertex % vertices_, vertex / vertices_ % vertices_, vertex / vertices_ / vertices_})
                points_.push_back(static_cast<float>(place) * spacing_ - half_side_);
        }
    }
    densities_.resize(wanted_.size());
    density(points_, densities_);
    for (std::size_t i = 0; i < wanted_.size(); ++i) density_[static_cast<std::size_t>(wanted_[i])] = densities_[i];
    known_vertices_ += static_cast<std::int64_t>(wanted_.size());
}

bool DensityGrid::bounds(std::span<const float> points, std::span<DensityBounds> result) const {
    bool all_known = true;
    for (std::size_t i = 0; i < result.size(); ++i) {
        const Cell cell = cell_of(points.data() + 3 * i);
        if (cell.corner < 0) {
            result[i] = anything;
            continue;
        }
        const float* corner = density_.data() + cell.corner;
        DensityBounds bounds{corner[0], 0.0F, corner[0]};
        for (std::int64_t z = 0; z < 2; ++z) {
            for (std::int64_t y = 0; y < 2; ++y) {
                const float* edge = corner + (z * vertices_ + y) * vertices_;
                bounds.lower = std::min({bounds.lower, edge[0], edge[1]});
                bounds.upper = std::max({bounds.upper, edge[0], edge[1]});
                const float share = (z == 1 ? cell.part[2] : 1.0F - cell.part[2]) * (y == 1 ? cell.part[1] : 1.0F - cell.part[1]);
                bounds.estimate += share * (edge[0] + cell.part[0] * (edge[1] - edge[0]));
            }
        }
        const bool known = bounds.lower >= 0.0F;
        result[i] = known ? bounds : anything;
        all_known = all_known && known;
    }
    return all_known;
}

}  // namespace stymo
