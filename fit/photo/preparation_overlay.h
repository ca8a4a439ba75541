#pragma once

#include "core/tensor.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/photo/landmarks.h"
#include "render/camera.h"

namespace stymo {

/// The photo (S, S, 3) in [0, 1] with the fitted head drawn over it, half transparent, in its
/// fitted colours and light.
[[nodiscard]] Tensor with_fitted_head(const Tensor& photo, const MorphableHead& head,
                                      const MorphableFit& fit, const Intrinsics& intrinsics);

/// The photo (side, side, 3) with the axes of the head, as seen by `camera`, drawn from the point
/// (0, 0, pivot_depth) on the face: x (to the image's right when frontal) red, y (up) green, z (out
/// of the face) blue.
[[nodiscard]] Tensor with_head_axes(const Tensor& photo, const Camera& camera, double pivot_depth);

/// The photo with landmarks (in pixels of the photo) as green dots.
[[nodiscard]] Tensor with_landmarks(const Tensor& photo, const Landmarks& landmarks);

/// The photo with the outline of a mask (side, side, 1) in yellow.
[[nodiscard]] Tensor with_mask_outline(const Tensor& photo, const Tensor& mask);

/// The results of preparing a photo, to be drawn on it.
struct PhotoWithFindings {
    Tensor image;         ///< (side, side, 3) in [0, 1]
    Tensor mask;          ///< (side, side, 1)
    Landmarks landmarks;  ///< in pixels of `image`
    MorphableFit fit;
};

/// The photo at `side` pixels, (side, side, 3), with the results drawn over it: the fitted head
/// half transparent, its axes (with_head_axes), the landmarks in green, the outline of the mask in
/// yellow.
[[nodiscard]] Tensor preparation_overlay(const PhotoWithFindings& photo, const MorphableHead& head,
                                         const Intrinsics& intrinsics, std::int64_t side);

}  // namespace stymo
