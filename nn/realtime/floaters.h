#pragma once

#include <cstdint>
#include <vector>

#include "nn/realtime/field_source.h"

namespace stymo {

/// Removes floaters, pieces that are separate from the head in a view. A field that was trained
/// only on frontal faces may place a part of an ear anywhere along the ray that showed it. Seen
/// from the side, such a part floats in the air.
class FloaterRemoval {
public:
    /// `map` has side x side rays. Neighbouring rays, also diagonal ones, with an opacity of at
    /// least 0.1 form a piece. Connected fainter rays belong to the nearest piece. All pieces
    /// except the one with the largest sum of opacities become empty, with the depth `background`.
    void apply(FeatureMap& map, std::int64_t side, double background);

private:
    void label_pieces(const FeatureMap& map, std::int64_t side);
    void spread(const FeatureMap& map, std::int64_t side, float least_opacity);

    std::vector<std::int32_t> pieces_;  ///< for each ray, -1: no piece
    std::vector<std::int32_t> queue_;   ///< rays whose neighbours are still to be visited
    std::vector<double> opacities_;     ///< sum for each piece
};

}  // namespace stymo
