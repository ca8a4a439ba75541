#include "nn/realtime/floaters.h"

#include <algorithm>

namespace stymo {
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
