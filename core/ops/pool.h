#pragma once

#include "core/autograd/variable.h"
#include "core/op_options.h"

/// Pooling of images (batch, height, width, channels). Derivatives of any order exist.
namespace stymo {

/// Largest element of each window and channel; at a tie the gradient goes to the first one in
/// row-major order. No padding. (batch, h, w, c) -> (batch, h', w', c) with h' = (h - kernel) /
/// stride + 1, rounded down, or up with ceil_mode. Throws ValueError for invalid options or a
/// kernel above 16, ShapeError for another rank or an image smaller than a window.
[[nodiscard]] Variable max_pool2d(const Variable& x, const MaxPoolOptions& options = {});

}  // namespace stymo
