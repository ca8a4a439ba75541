#pragma once

#include "core/tensor.h"

namespace stymo {

/// The head (face, hair, ears) of a class map (side, side, 1) with CelebAMask-HQ's indices, as 0 or
/// 1. As in HeadNeRF's correct_head_mask.py, it is the largest connected component; then the border
/// between hair and background, where background shows through, is eroded by 7 of 512 pixels; then
/// the largest component of the result is kept.
[[nodiscard]] Tensor head_mask_from_parsing(const Tensor& classes);

/// The largest 8-connected component, without holes, of a mask (height, width, 1) thresholded at
/// 0.5; 0 or 1.
[[nodiscard]] Tensor clean_head_mask(const Tensor& mask);

/// Intersection over union of two masks; a pixel belongs to a mask if its value is above 0.5. It is
/// 1 for two empty masks. Throws ShapeError for masks of different shapes.
[[nodiscard]] double intersection_over_union(const Tensor& a, const Tensor& b);

/// Mean of a mask: the share of the image that it covers.
[[nodiscard]] double covered_share(const Tensor& mask);

}  // namespace stymo
