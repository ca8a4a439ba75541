#pragma once

#include "core/ops/linalg.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// Batched product of rank-3 tensors; a leading extent of 1 serves every matrix of the other. Shapes are checked by the op.
[[nodiscard]] Tensor matmul(const Tensor& a, const Tensor& b, MatmulOptions options);

/// c (m, n) = or += op(a) op(b) on the calling thread; row-major; the inner length is k. Contiguous, except that the rows of
/// `a` as it is stored may be `stride_a` elements apart (0: no gaps).
template <class T>
void multiply_into(T* c, const T* a, const T* b, std::int64_t m, std::int64_t n, std::int64_t k, MatmulOptions options,
                   bool accumulate, std::int64_t stride_a = 0);

struct LinearResult {
    Tensor value;
    Tensor slope;  ///< derivative of the activation at the linear map's result; undefined unless wanted
};

/// The fused pointwise layer of core/ops/linalg.h: product, bias, activation and (if wanted) slope, tile by tile.
[[nodiscard]] LinearResult linear(const Tensor& x, const Tensor& weight, const Tensor& bias, Activation activation,
                                  bool with_slope);

}  // namespace stymo::kernels
