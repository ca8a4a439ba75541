#pragma once

#include <optional>

#include "nn/models/face_batch.h"
#include "render/morphable/head.h"

namespace stymo {

/// A photo's face as seen by a camera that is turned about the head's middle by these angles
/// (radians). Its colours are the photo's, moved by the linear head that was fitted to the photo.
/// Pixels are unknown where the photo does not show what that camera sees, and beside the part of
/// the face that 68 landmarks enclose. This is face profiling (Zhu et al., "Face Alignment Across
/// Large Poses: A 3D Solution", 2016) without invented pixels. Nothing for a face that has no pose,
/// no code or is mirrored, and if less than a hundredth of the image would be known.
[[nodiscard]] std::optional<Face> turned_face(const Face& face, const MorphableHead& head,
                                              double yaw, double pitch);

}  // namespace stymo
