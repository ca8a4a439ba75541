#pragma once

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// A photo or a rendered view of a face, with its camera and the face's depth map.
struct SeenFace {
    Camera camera;
    Tensor image;  ///< (S, S, 3)
    Tensor mask;   ///< (S, S, 1), 1 on the head
    Tensor depth;  ///< (R, R, 1), see render/depth_map.h
};

/// For depth maps that have far fewer pixels than the photo.
inline constexpr double coarse_depth_tolerance = 0.012;

/// A view with the photo's colours where the photo shows the same points of the head.
struct TurnedPhoto {
    Tensor image;  ///< (S, S, 3): the photo's colours where it shows the point, else the view's
    Tensor seen;   ///< (S, S, 1) in [0, 1]: the weight of the photo's colour
};

/// Reprojects a photo into another view. Each pixel of the view is mapped to a point of the head by
/// its depth. The photo shows this point unless it is occluded: its depth map then disagrees with
/// the point's depth by more than `tolerance` times this depth. The weight falls to 0 towards the
/// border of the visible region. All tensors are float32.
[[nodiscard]] TurnedPhoto turned_photo(const SeenFace& photo, const SeenFace& view,
                                       double tolerance = coarse_depth_tolerance);

}  // namespace stymo
