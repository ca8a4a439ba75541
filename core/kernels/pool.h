#pragma once

#include <cstdint>
#include <vector>

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// For each element of a pooled image the place of the chosen element in its window, in row-major
/// order.
using WindowPlaces = std::vector<std::uint8_t>;
/// Windows up to this side have places that fit.
inline constexpr int max_pool_kernel = 16;

struct MaxPooled {
    Tensor values;
    WindowPlaces places;
};

/// Largest element of each window; a NaN counts as largest.
[[nodiscard]] MaxPooled max_pool2d(const Tensor& x, const Shape& output_shape,
                                   const MaxPoolOptions& options);
/// The elements of x at the given places, of `output_shape`.
[[nodiscard]] Tensor gather_windows(const Tensor& x, const WindowPlaces& places,
                                    const Shape& output_shape, const MaxPoolOptions& options);
/// Zeros of `input_shape` with each element of y added at its place; the adjoint of gather_windows.
[[nodiscard]] Tensor scatter_windows(const Tensor& y, const WindowPlaces& places,
                                     const Shape& input_shape, const MaxPoolOptions& options);

}  // namespace stymo::kernels
