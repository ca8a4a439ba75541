#pragma once

#include "core/autograd/variable.h"

/// Pooling of images (batch, height, width, channels), closed under differentiation to any order.
namespace stymo {

struct MaxPoolOptions {
    int kernel = 2;
    int stride = 2;
    bool ceil_mode = false;  ///< also a last window that reaches beyond the image, as PyTorch's ceil_mode
};

/// Largest element of each window and channel; at a tie the gradient goes to the first one in row-major order. No padding.
/// (batch, h, w, c) -> (batch, h', w', c) with h' = (h - kernel) / stride + 1, rounded down, or up with ceil_mode.
[[nodiscard]] Variable max_pool2d(const Variable& x, const MaxPoolOptions& options = {});

}  // namespace stymo
