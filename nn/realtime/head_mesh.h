#pragma once

#include <cstdint>

#include "nn/models/model.h"
#include "render/triangle_mesh.h"

namespace stymo {

struct HeadMeshOptions {
    std::int64_t resolution = 128;  ///< cells along the longest side of the box around the head
    double level = 2.0;  ///< density at the surface, per unit of length; at 2, a third of a unit
                         ///< absorbs half of the light
};

/// The isosurface of the density at `options.level` for row `index` of codes in Z, in world
/// coordinates. It is closed, and only its largest connected piece is kept. The search covers the
/// volume that the model's frontal camera sees from the near plane to the back of a head. Training
/// constrains no surface that photos do not show, so the back of the head is arbitrary. Throws
/// ValueError if no density reaches the level, or for a resolution below 2.
[[nodiscard]] TriangleMesh head_mesh(const Model& model, const Codes& codes, std::int64_t index,
                                     const HeadMeshOptions& options);

}  // namespace stymo
