#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"
#include "render/camera.h"

namespace stymo {

/// The photo (side, side, 3) with the axes of the head, as seen by `camera`, drawn from the point
/// (0, 0, pivot_depth) on the face: x (to the image's right when frontal) red, y (up) green, z (out
/// of the face) blue.
[[nodiscard]] Tensor with_head_axes(const Tensor& photo, const Camera& camera, double pivot_depth);

/// The photo with landmarks (in pixels of the photo) as green dots.
[[nodiscard]] Tensor with_landmarks(const Tensor& photo, const Landmarks& landmarks);

/// The photo with the outline of a mask (side, side, 1) in yellow.
[[nodiscard]] Tensor with_mask_outline(const Tensor& photo, const Tensor& mask);

}  // namespace stymo
