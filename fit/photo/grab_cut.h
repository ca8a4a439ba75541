#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// What is known of where the head is besides the landmarks.
struct HeadPrior {
    Tensor probability;  ///< of each pixel to belong to the head, (side, side, 1); undefined: none
    /// Whether it is a face parser's, sharp and mostly right, so that it may overrule the
    /// landmarks. Otherwise it is a blurred guess, as a model's opacity, and the landmarks are
    /// certain.
    bool is_sharp = false;
};

/// The head (face, hair, ears) of an aligned crop (side, side, 3), as 0 or 1 in (side, side, 1),
/// found by GrabCut (C. Rother et al., 2004) from where the landmarks and the prior say that face,
/// hair, neck and background are. Throws ShapeError for a crop or probabilities of other shapes,
/// ValueError for landmarks of a face that is not upright.
[[nodiscard]] Tensor grab_cut_head_mask(const Tensor& crop, const Landmarks& landmarks,
                                        const HeadPrior& prior = {});

}  // namespace stymo
