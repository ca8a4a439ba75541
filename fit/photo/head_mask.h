#pragma once

#include "core/tensor.h"

namespace stymo {

/// The head (face, hair, ears) of a class map (side, side, 1) with CelebAMask-HQ's indices, as 0 or
/// 1: the largest connected component; the border between hair and background eroded by 7 pixels of
/// 512, because background shows through there; and of this the largest component. As HeadNeRF's
/// correct_head_mask.py.
[[nodiscard]] Tensor head_mask_from_parsing(const Tensor& classes);

/// A mask (height, width, 1), set where above 0.5, as 0 or 1: its largest component, 8-connected,
/// without holes.
[[nodiscard]] Tensor clean_head_mask(const Tensor& mask);

/// Intersection over union of two masks; a pixel belongs to a mask if its value is above 0.5. Two
/// empty masks are equal: 1. Throws ShapeError for masks of different shapes.
[[nodiscard]] double intersection_over_union(const Tensor& a, const Tensor& b);

/// Mean of a mask: the share of the image it covers.
[[nodiscard]] double covered_share(const Tensor& mask);

}  // namespace stymo
