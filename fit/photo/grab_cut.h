#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// The head (face, hair, ears) of an aligned crop (side, side, 3), as 0 or 1 in (side, side, 1),
/// found by GrabCut (C. Rother et al., 2004) from where the landmarks say that face, hair, neck and
/// background are. Used without a face parser.
///
/// `head_probability`: the probability of each pixel according to a face parser, (side, side, 1),
/// whose errors GrabCut corrects. The landmarks may overrule it, but are not treated as certain.
/// Throws ShapeError for a crop or probabilities of other shapes, ValueError for landmarks of a
/// face that is not upright.
[[nodiscard]] Tensor grab_cut_head_mask(const Tensor& crop, const Landmarks& landmarks,
                                        const Tensor& head_probability = {});

}  // namespace stymo
