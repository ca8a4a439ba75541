#pragma once

#include "core/tensor.h"

namespace stymo {

/// Image `index` of (B, S, S, 3) in [-1, 1] as an image (S, S, 3) in [0, 1].
[[nodiscard]] Tensor display_image(const Tensor& images, std::int64_t index);
/// Mask `index` of (B, S, S, 1) as (S, S, 1).
[[nodiscard]] Tensor display_mask(const Tensor& masks, std::int64_t index);
/// image * mask, black outside the head: what the metrics of the paper compare.
[[nodiscard]] Tensor masked_image(const Tensor& image, const Tensor& mask);

}  // namespace stymo
