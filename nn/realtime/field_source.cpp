#include "nn/realtime/field_source.h"

#include <algorithm>
#include <cmath>

namespace stymo {

SampleRange samples_in_trained_volume(const CameraConfig& trained, const Camera& camera,
                                      const Ray& ray, std::int64_t samples_per_ray) {
    constexpr double room = 1.25;
    const double slope = 0.5 * room / trained.intrinsics.focal,
                 height = trained.distance - trained.pivot_depth;
    const Eigen::Vector3d from_pivot = ray.origin - Eigen::Vector3d(0.0, 0.0, trained.pivot_depth);
    const Eigen::Vector3d start = camera.world_from_camera.transpose() * from_pivot,
                          step = camera.world_from_camera.transpose() * ray.direction;
    // At distance t on the ray, each side of the volume bounds by offset + t * rate <= 0. The side
    // towards the optical axis moves with it, so that cameras that turn around the head's origin
    // instead of the pivot see their whole image.
    double nearest = ray.near_distance, farthest = ray.far_distance;
    for (const Eigen::Index axis : {0, 1}) {
        for (const double side : {-1.0, 1.0}) {
            const double shift = std::clamp(side * start[axis], 0.0, std::abs(trained.pivot_depth));
            const double offset = side * start[axis] - shift - slope * (height + start[2]);
            const double rate = side * step[axis] - slope * step[2];
            if (rate > 0.0) {
                farthest = std::min(farthest, -offset / rate);
            } else if (rate < 0.0) {
                nearest = std::max(nearest, -offset / rate);
            } else if (offset > 0.0) {
                return {};
            }
        }
    }
    const double samples = static_cast<double>(samples_per_ray),
                 per_unit = samples / (ray.far_distance - ray.near_distance);
    const auto count_below = [&](double distance) {
        return std::clamp((distance - ray.near_distance) * per_unit, 0.0, samples);
    };
    const double first = std::ceil(count_below(nearest)), end = std::ceil(count_below(farthest));
    if (!(first < end)) return {};
    return {static_cast<std::int32_t>(first), static_cast<std::int32_t>(end)};
}

namespace {

constexpr float solid = 0.1F;
/// A fainter ray changes a pixel by less than one 8-bit step.
constexpr float visible = 0.002F;
constexpr std::int32_t none = -1;

template <class Visit>
void for_each_neighbour(std::int64_t ray, std::int64_t side, const Visit& visit) {
    const std::int64_t row = ray / side, column = ray % side;
    for (std::int64_t r = std::max<std::int64_t>(row - 1, 0); r <= std::min(row + 1, side - 1); ++r)
        for (std::int64_t c = std::max<std::int64_t>(column - 1, 0);
             c <= std::min(column + 1, side - 1); ++c)
            visit(static_cast<std::size_t>(r * side + c));
}

}  // namespace

/// Breadth-first search from the rays in the queue: rays without a piece that have at least this
/// opacity get the piece of their neighbour.
void FloaterRemoval::spread(const FeatureMap& map, std::int64_t side, float least_opacity) {
    for (std::size_t next = 0; next < queue_.size(); ++next) {
        const std::int32_t ray = queue_[next], piece = pieces_[static_cast<std::size_t>(ray)];
        for_each_neighbour(ray, side, [&](std::size_t neighbour) {
            if (pieces_[neighbour] != none || map.opacities[neighbour] < least_opacity) return;
            pieces_[neighbour] = piece;
            queue_.push_back(static_cast<std::int32_t>(neighbour));
        });
    }
}

void FloaterRemoval::label_pieces(const FeatureMap& map, std::int64_t side) {
    pieces_.assign(map.opacities.size(), none);
    opacities_.clear();
    for (std::size_t ray = 0; ray < pieces_.size(); ++ray) {
        if (pieces_[ray] != none || map.opacities[ray] < solid) continue;
        pieces_[ray] = static_cast<std::int32_t>(opacities_.size());
        queue_.assign(1, static_cast<std::int32_t>(ray));
        spread(map, side, solid);
        double& sum = opacities_.emplace_back(0.0);
        for (const std::int32_t member : queue_)
            sum += static_cast<double>(map.opacities[static_cast<std::size_t>(member)]);
    }
}

void FloaterRemoval::apply(FeatureMap& map, std::int64_t side, double background) {
    label_pieces(map, side);
    if (opacities_.size() < 2) return;
    queue_.clear();
    for (std::size_t ray = 0; ray < pieces_.size(); ++ray)
        if (pieces_[ray] != none) queue_.push_back(static_cast<std::int32_t>(ray));
    spread(map, side, visible);
    const auto head =
        static_cast<std::int32_t>(std::ranges::max_element(opacities_) - opacities_.begin());
    const std::size_t channels = map.features.size() / pieces_.size();
    for (std::size_t ray = 0; ray < pieces_.size(); ++ray) {
        if (pieces_[ray] == none || pieces_[ray] == head) continue;
        std::fill_n(map.features.begin() + static_cast<std::ptrdiff_t>(ray * channels), channels,
                    0.0F);
        map.occupied[ray] = 0;
        map.opacities[ray] = 0.0F;
        map.depths[ray] = static_cast<float>(background);
    }
}

}  // namespace stymo
