#pragma once

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

[[nodiscard]] Tensor gather_rows(const Tensor& x, const RowIndices& rows);
[[nodiscard]] Tensor scatter_add_rows(const Tensor& x, const RowIndices& rows,
                                      std::int64_t row_count);

}  // namespace stymo::kernels
