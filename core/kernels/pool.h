#pragma once

#include <cstdint>
#include <vector>

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// For each element of a pooled image, the row-major index of the chosen element in its window.
using WindowIndices = std::vector<std::uint8_t>;
/// Largest side of a window whose indices fit into 8 bits.
inline constexpr int max_pool_kernel = 16;

struct MaxPooled {
    Tensor values;
    WindowIndices indices;
};

/// Largest element of each window; a NaN counts as largest.
[[nodiscard]] MaxPooled max_pool2d(const Tensor& x, const Shape& output_shape,
                                   const MaxPoolOptions& options);
/// The elements of x at the given indices of their windows; the result has `output_shape`.
[[nodiscard]] Tensor gather_windows(const Tensor& x, const WindowIndices& indices,
                                    const Shape& output_shape, const MaxPoolOptions& options);
/// Adds each element of y at its index to zeros of `input_shape`; the adjoint of gather_windows.
[[nodiscard]] Tensor scatter_windows(const Tensor& y, const WindowIndices& indices,
                                     const Shape& input_shape, const MaxPoolOptions& options);

}  // namespace stymo::kernels
