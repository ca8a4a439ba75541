#pragma once

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// A photo, or a view of a face, with where it was taken from and the face's depth there.
struct SeenFace {
    Camera camera;
    Tensor image;  ///< (S, S, 3)
    Tensor mask;   ///< (S, S, 1), 1 on the head
    Tensor depth;  ///< (R, R, 1) as render/depth_map.h
};

/// How a view looks where the photo shows the same points of the head.
struct TurnedPhoto {
    Tensor image;  ///< (S, S, 3): the photo's colours where it shows the point, else the view's
    Tensor seen;   ///< (S, S, 1) in [0, 1]: the share of the photo's colour
};

/// Each pixel of the view is a point of the head by its depth, which the photo shows unless
/// something stands before it. The share falls to 0 towards the rim of what is seen. All tensors
/// are float32.
[[nodiscard]] TurnedPhoto turned_photo(const SeenFace& photo, const SeenFace& view);

}  // namespace stymo
