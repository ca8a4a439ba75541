#pragma once

#include <cstdint>

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

/// Inner products of each of `count_x` vectors with each of a few others. Such a product reads its
/// larger operand only once, so packing would take longer. On both sides the vectors of length k
/// are contiguous, one after the other.
template <class T>
struct Dots {
    const T* x;
    std::int64_t count_x;
    const T* y;
    std::int64_t count_y;
    std::int64_t k;
    T* c;  ///< element (i, j) at i * stride_x + j * stride_y
    std::int64_t stride_x;
    std::int64_t stride_y;
};

/// Adds the products in each vector lane, and then the lanes, so the order of the sum depends on
/// the instruction set.
template <class T>
void multiply_dots(const Dots<T>& dots);

/// The pointwise layer of core/ops/linalg.h with a leaky ReLU: y = gain * leaky_relu(x W^T + bias,
/// slope).
struct LeakyLinear {
    Tensor x;       ///< (batch, rows, in); undefined if `weight` is not wanted
    Tensor weight;  ///< (batch or 1, out, in); undefined if `x` is not wanted
    Tensor y;       ///< (batch, rows, out)
    double slope = 0.0;
    double gain = 1.0;
};

struct LinearWanted {
    bool x = false;
    bool weight = false;
    bool bias = false;
};

/// The gradients that are wanted; the others are undefined.
struct LinearGradients {
    Tensor x;       ///< like LeakyLinear::x
    Tensor weight;  ///< (batch or 1, out, in): summed over the batch if `shares_weight`
    Tensor bias;    ///< (out), a sum over batch and rows
};

/// Computes all gradients in one pass, in which the gradient before the activation never leaves the
/// cache. Sums over rows are added in pieces of fixed length, so that results do not depend on the
/// number of threads.
[[nodiscard]] LinearGradients leaky_linear_gradients(const Tensor& dL_dy, const LeakyLinear& layer,
                                                     bool shares_weight, LinearWanted wanted);

}  // namespace stymo::kernels
