#pragma once

#include <cstdint>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// Throws ShapeError unless `image` is (height, width, channels) with 1 or 3 channels (or 4, if it
/// may be transparent) and at least one pixel.
void require_image(const Tensor& image, const char* operation, bool may_be_transparent = false);
/// Values clipped to [0, 1] and rounded to 0..255, row-major; NaN becomes 0.
[[nodiscard]] std::vector<std::uint8_t> image_bytes(const Tensor& image);

}  // namespace stymo
