#pragma once

#include <optional>

#include "nn/models/face_batch.h"
#include "render/morphable/head.h"

namespace stymo {

/// A photo's face as seen by a camera that is turned about the head's middle by these angles
/// (radians). Its colours are the photo's, moved by the linear head that was fitted to the photo.
/// Known are the points of the face, within its 68 landmarks, that both cameras see, and the
/// background where all that the camera could see of a head lies in front of the photo's head or
/// on its background. This is face profiling (Zhu et al., "Face Alignment Across
/// Large Poses: A 3D Solution", 2016) without invented pixels. Nothing for a face that has no pose,
/// no code or is mirrored, and if less than a hundredth of the image would show it.
[[nodiscard]] std::optional<Face> turned_face(const Face& face, const MorphableHead& head,
                                              double yaw, double pitch);

}  // namespace stymo
