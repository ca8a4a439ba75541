#pragma once

#include "core/resample_matrix.h"
#include "core/tensor.h"

namespace stymo::kernels {

[[nodiscard]] Tensor resample(const Tensor& x, const ResampleMatrix& vertical,
                              const ResampleMatrix& horizontal);

}  // namespace stymo::kernels
