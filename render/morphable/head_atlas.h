#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/morphable/head.h"

namespace stymo {

/// The surface of a head laid out on a square texture: the grids of the built-in head as they are,
/// each connected piece of a scan as a cylinder. It depends on the head alone, not on codes.
struct HeadAtlas {
    std::vector<std::int32_t> vertex;  ///< the head's vertex of each of M; twice where a seam is
    Tensor uv;                         ///< (M, 2) in [0, 1], v downwards
    std::vector<std::array<std::int32_t, 3>> triangles;  ///< of M, in the order of the head's
};

[[nodiscard]] HeadAtlas head_atlas(const MorphableHead& head);

/// Rows `atlas.vertex` of values (V, columns) of the head's vertices.
[[nodiscard]] Tensor at_atlas_vertices(const HeadAtlas& atlas, const Tensor& values);

}  // namespace stymo
