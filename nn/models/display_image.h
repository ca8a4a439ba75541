#pragma once

#include "core/tensor.h"

namespace stymo {

/// Throws NumericError for a rendered image, mask or depth map with a value that is not finite.
void require_finite(const Tensor& rendered);

/// Image `index` of (B, S, S, 3) in [-1, 1] as an image (S, S, 3) in [0, 1]. Throws NumericError
/// for an image that is not finite.
[[nodiscard]] Tensor display_image(const Tensor& images, std::int64_t index);
/// Mask `index` of (B, S, S, 1) as (S, S, 1).
[[nodiscard]] Tensor display_mask(const Tensor& masks, std::int64_t index);
/// image * mask, black outside the head: what the metrics of the paper compare.
[[nodiscard]] Tensor masked_image(const Tensor& image, const Tensor& mask);

}  // namespace stymo
