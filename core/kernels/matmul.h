#pragma once

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// Batched product of rank-3 tensors; a leading extent of 1 serves every matrix of the other.
/// Shapes are checked by the op.
[[nodiscard]] Tensor matmul(const Tensor& a, const Tensor& b, MatmulOptions options);

/// c (m, n) = or += op(a) op(b); row-major and contiguous; the inner length is k. Packs the right
/// operand: where several products share it, core/kernels/gemm.h does that once.
template <class T>
void multiply_into(T* c, const T* a, const T* b, std::int64_t m, std::int64_t n, std::int64_t k,
                   MatmulOptions options, bool accumulate);

struct LinearResult {
    Tensor value;
    Tensor slope;  ///< derivative of the activation at the linear map's result; undefined unless
                   ///< wanted
};

/// The fused pointwise layer of core/ops/linalg.h: product, bias, activation and (if wanted) slope,
/// tile by tile.
[[nodiscard]] LinearResult linear(const Tensor& x, const Tensor& weight, const Tensor& bias,
                                  Activation activation, bool with_slope);

}  // namespace stymo::kernels
