#pragma once

#include "core/tensor.h"
#include "nn/pretrained/head_mask_network.h"

namespace stymo {

/// The probabilities (height, width, 1) of a head-mask network without what is not the head: 0
/// outside the largest 8-connected component of those above 0.5, and 1 in its holes of less than
/// 3 % of its area and farther inside than a 64th of the side. Between them the edge stays soft.
[[nodiscard]] Tensor soft_head_mask(const Tensor& probability);

/// The head mask of an aligned crop (S, S, 3) in [0, 1]: the probabilities of the network, what
/// `soft_head_mask` leaves of them, and the edge that `edge_by_color` finds.
[[nodiscard]] Tensor head_mask(const HeadMaskModel& model, const Tensor& crop);

/// Intersection over union of two masks; a pixel belongs to a mask if its value is above 0.5. It is
/// 1 for two empty masks. Throws ShapeError for masks of different shapes.
[[nodiscard]] double intersection_over_union(const Tensor& a, const Tensor& b);

/// Mean of a mask: the share of the image that it covers.
[[nodiscard]] double covered_share(const Tensor& mask);

}  // namespace stymo
