#pragma once

#include <vector>

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

[[nodiscard]] Tensor permute(const Tensor& x, const std::vector<int>& order);
[[nodiscard]] Tensor flip(const Tensor& x, int axis);
[[nodiscard]] Tensor slice(const Tensor& x, int axis, std::int64_t begin, std::int64_t end);
[[nodiscard]] Tensor concat(const std::vector<Tensor>& parts, int axis);
/// If `coarse` is defined, each of its pixels is added to the four upsampled pixels at its
/// position.
[[nodiscard]] Tensor pixel_shuffle(const Tensor& x, const Tensor& coarse = {});
[[nodiscard]] Tensor pixel_unshuffle(const Tensor& x);

[[nodiscard]] Tensor gather_rows(const Tensor& x, const RowIndices& rows);
[[nodiscard]] Tensor scatter_add_rows(const Tensor& x, const RowIndices& rows,
                                      std::int64_t row_count);

}  // namespace stymo::kernels
