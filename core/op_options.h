#pragma once

#include <cstdint>
#include <vector>

/// Arguments that ops share with their kernels.
namespace stymo {

struct MatmulOptions {
    bool transpose_a = false;  ///< use the transpose of a's last two axes
    bool transpose_b = false;
};

/// The activation after a linear map, applied while its result is still in cache.
enum class Activation { none, sine, leaky_relu };

struct Conv2dOptions {
    int stride = 1;
    int padding = 0;  ///< number of zeros on every side
    int groups = 1;
};

struct MaxPoolOptions {
    int kernel = 2;
    int stride = 2;
    /// Adds a last window that extends beyond the image, like PyTorch's ceil_mode.
    bool ceil_mode = false;
};

using RowIndices = std::vector<std::int64_t>;

}  // namespace stymo
