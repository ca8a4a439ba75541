#pragma once

#include <cstdint>
#include <vector>

#include "fit/laid_head.h"
#include "render/morphable/arkit_shapes.h"
#include "render/texture.h"

namespace stymo {

/// A face as other programs use it: the topology of a linear head on the surface of a model's face,
/// with a texture and ARKit's blend shapes.
struct FaceMesh {
    TexturedMesh surface;  ///< M vertices, world coordinates
    ArkitShapes shapes;    ///< of the head
    Tensor targets;        ///< (52, M, 3): displacements by the shapes on this surface
    LaidHead head;         ///< before seams were cut
};

/// `texture_side` as in baked_texture. A neutral mesh lacks
/// the expression that the head has in the photo. Throws what `surface_views` and `fitted_head`
/// throw.
[[nodiscard]] FaceMesh face_mesh(const Model& model, const Codes& codes, const MorphableHead& head,
                                 const LandmarkModel& landmarks, std::int64_t texture_side,
                                 bool neutral = false);

}  // namespace stymo
