#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// A prior on the position of the head, in addition to the landmarks.
struct HeadPrior {
    Tensor probability;  ///< probability that a pixel belongs to the head, (side, side, 1);
                         ///< undefined: no prior
    /// true: it comes from a face parser, is sharp and mostly correct, and may overrule the
    /// landmarks. false: it is a blurred estimate, such as a model's opacity, and the landmarks
    /// take precedence.
    bool is_sharp = false;
};

/// The mask (side, side, 1), 0 or 1, of the head (face, hair, ears) in an aligned crop (side, side,
/// 3), found by GrabCut (C. Rother et al., 2004). It is initialised with regions for face, hair,
/// neck and background from the landmarks and the prior. Throws ShapeError for a crop or
/// probabilities of other shapes, ValueError for landmarks of a face that is not upright.
[[nodiscard]] Tensor grab_cut_head_mask(const Tensor& crop, const Landmarks& landmarks,
                                        const HeadPrior& prior = {});

}  // namespace stymo
