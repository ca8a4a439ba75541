#pragma once

#include <cstdint>

#include "nn/models/model.h"
#include "render/triangle_mesh.h"

namespace stymo {

struct HeadMeshOptions {
    std::int64_t resolution = 128;  ///< cells along the longest side of the box around the head
    double level = 2.0;  ///< density of the surface, for each unit of length: a third of a unit
                         ///< absorbs half of the light
};

/// The surface of one face of codes in Z where its density is the level, in world coordinates:
/// closed, its largest piece alone. Searched is what the model's frontal camera sees between the
/// near plane and the back of a head; whoever looks from behind sees what training left there.
/// Throws ValueError if no density reaches the level, or for a resolution below 2.
[[nodiscard]] TriangleMesh head_mesh(const Model& model, const Codes& codes, std::int64_t index,
                                     const HeadMeshOptions& options);

}  // namespace stymo
