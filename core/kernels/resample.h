#pragma once

#include "core/ops/resample.h"
#include "core/tensor.h"

namespace stymo::kernels {

[[nodiscard]] Tensor resample(const Tensor& x, const ResampleMatrix& vertical, const ResampleMatrix& horizontal);

}  // namespace stymo::kernels
