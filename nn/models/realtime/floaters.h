#pragma once

#include <cstdint>
#include <vector>

#include "nn/models/realtime/field_source.h"

namespace stymo {

/// Removes what floats beside the head in a view. A field that has seen faces from the front alone
/// may put a part of an ear somewhere along the ray that showed it; seen from the side, such a
/// part hangs in the air.
class FloaterRemoval {
public:
    /// `map` has side x side rays. Rays of an opacity of at least a tenth that touch each other,
    /// also at a corner, are one piece, and fainter rays belong to the piece that is nearest.
    /// Empties the rays of all pieces but that with the most opacity; their depth becomes
    /// `background`.
    void apply(FeatureMap& map, std::int64_t side, double background);

private:
    void label_pieces(const FeatureMap& map, std::int64_t side);
    void spread(const FeatureMap& map, std::int64_t side, float least_opacity);

    std::vector<std::int32_t> pieces_;  ///< of each ray, -1: of none
    std::vector<std::int32_t> queue_;   ///< rays whose neighbours are still to be visited
    std::vector<double> opacities_;     ///< of each piece
};

}  // namespace stymo
