#pragma once

#include <vector>

#include "core/tensor.h"
#include "render/camera.h"
#include "render/morphable/head.h"

namespace stymo {

/// What a camera sees of a linear head's face: the part within the convex hull of its 68 landmarks.
struct FaceSurface {
    Tensor depth;  ///< (R, R, 1), see render/depth_map.h; 0 beside the face
    Tensor face;   ///< (R, R, 1), 1 on the face, 0 beside it
};

/// The face of a head whose vertices are (V, 3) in world coordinates, on R = `side` rays along each
/// side of the image. Throws what `rasterize` throws.
[[nodiscard]] FaceSurface face_surface(const MorphableHead& head, const Tensor& vertices,
                                       const Camera& camera, std::int64_t side);

/// The differences `depths` - `surface.depth` on the face. Throws ShapeError if `depths` is not a
/// depth map of the surface's size.
[[nodiscard]] std::vector<double> depth_differences(const Tensor& depths,
                                                    const FaceSurface& surface);

/// The vertices, moved along the camera's line of sight so that the median of `depth_differences`
/// becomes 0: a head that was fitted to landmarks stands where the depth map has its face. They
/// stay where they are if the camera sees nothing of the face.
[[nodiscard]] Tensor moved_to_depth(const MorphableHead& head, const Tensor& vertices,
                                    const Camera& camera, const Tensor& depths);

/// The distance between the middles of the two eyes.
[[nodiscard]] double eye_distance(const MorphableHead& head, const Tensor& vertices);

}  // namespace stymo
