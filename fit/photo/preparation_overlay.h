#pragma once

#include "fit/morphable/morphable_fit.h"

namespace stymo {

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
