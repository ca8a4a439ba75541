#pragma once

#include "core/op_options.h"
#include "core/tensor.h"

namespace stymo::kernels {

/// Batched product of rank-3 tensors. An operand with leading extent 1 is used for every matrix of
/// the other. The op checks the shapes.
[[nodiscard]] Tensor matmul(const Tensor& a, const Tensor& b, MatmulOptions options);

/// c (m, n) = or += op(a) op(b), with inner length k; all are row-major and contiguous. Packs the
/// right operand on each call; PackedMatrix of core/kernels/gemm.h packs it once for several
/// products.
template <class T>
void multiply_into(T* c, const T* a, const T* b, std::int64_t m, std::int64_t n, std::int64_t k,
                   MatmulOptions options, bool accumulate);

struct LinearResult {
    Tensor value;
    Tensor slope;  ///< derivative of the activation at the result of the linear map; undefined
                   ///< unless `with_slope`
};

/// The fused pointwise layer of core/ops/linalg.h: product, bias, activation and, if `with_slope`,
/// the derivative of the activation.
[[nodiscard]] LinearResult linear(const Tensor& x, const Tensor& weight, const Tensor& bias,
                                  Activation activation, bool with_slope);

}  // namespace stymo::kernels
