#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// The head (face, hair, ears) of an aligned crop (side, side, 3), as 0 or 1 in (side, side, 1), found by GrabCut (C. Rother et
/// al., 2004) from where the landmarks say that face, hair, neck and background are. The fallback for want of a parsing network.
///
/// `head_probability`: what a parsing network says of each pixel, (side, side, 1); GrabCut then mends its errors. The landmarks
/// may overrule it, but are not certain then. Throws ShapeError for a crop or probabilities of other shapes, ValueError for
/// landmarks of a face that is not upright.
[[nodiscard]] Tensor grab_cut_head_mask(const Tensor& crop, const Landmarks& landmarks, const Tensor& head_probability = {});

}  // namespace stymo
