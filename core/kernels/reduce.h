#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

/// Sum over the axes marked in `reduced` (one flag for each axis), kept with extent 1. Chunks and
/// their order are fixed, so that the result does not depend on the number of threads.
[[nodiscard]] Tensor sum(const Tensor& x, std::uint32_t reduced);
/// Largest element along the axis, kept with extent 1.
[[nodiscard]] Tensor maximum_along(const Tensor& x, int axis);
[[nodiscard]] Tensor cumsum(const Tensor& x, int axis, bool exclusive);

}  // namespace stymo::kernels
