#pragma once

#include <functional>

#include "core/tensor.h"
#include "nn/pretrained/head_mask_network.h"

namespace stymo {

/// The probabilities (height, width, 1) of a head-mask network without what is not the head: 0
/// outside the largest 8-connected component of those above 0.5, and 1 in its holes of less than
/// 3 % of its area and farther inside than a 64th of the side. Between them the edge stays soft.
[[nodiscard]] Tensor soft_head_mask(const Tensor& probability);

/// Pixels on each side of a crop of this side that SurroundedCrop shows too.
[[nodiscard]] constexpr std::int64_t head_mask_margin(std::int64_t side) {
    return side / 8;
}
/// Cuts a crop with its margin out of the photo, (S + 2 M, S + 2 M, 3) with M =
/// head_mask_margin(S).
using SurroundedCrop = std::function<Tensor()>;

/// Probabilities (M + S, S, 1) of a crop and of what is above it, from those of the crop alone
/// (S, S, 1) and of the crop with its margin. Above the crop they are the latter. In row r of the
/// crop they are those of the crop alone, but at most the latter plus (r / M)^2. Throws ShapeError
/// for another margin.
[[nodiscard]] Tensor bounded_at_top(const Tensor& alone, const Tensor& surrounded);

/// The head mask of an aligned crop (S, S, 3) in [0, 1]: the probabilities of the network, what
/// `soft_head_mask` leaves of them, and the edge that `edge_by_color` finds. Where hair nearly
/// reaches the top of the crop, the network takes what is above it for head, up to the top. So if
/// the head seems to reach the top, the crop is also looked at with its surroundings, if there are
/// any (bounded_at_top).
[[nodiscard]] Tensor head_mask(const HeadMaskModel& model, const Tensor& crop,
                               const SurroundedCrop& surrounded = {});

/// Intersection over union of two masks; a pixel belongs to a mask if its value is above 0.5. It is
/// 1 for two empty masks. Throws ShapeError for masks of different shapes.
[[nodiscard]] double intersection_over_union(const Tensor& a, const Tensor& b);

/// Mean of a mask: the share of the image that it covers.
[[nodiscard]] double covered_share(const Tensor& mask);

}  // namespace stymo
