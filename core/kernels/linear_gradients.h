#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

/// The pointwise layer of core/ops/linalg.h behind a leaky ReLU: y = gain * leaky(x W^T + bias).
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

/// Gradients of what is wanted; the others are undefined.
struct LinearGradients {
    Tensor x;       ///< as LeakyLinear::x
    Tensor weight;  ///< (batch or 1, out, in): a sum over the batch where `shares_weight`
    Tensor bias;    ///< (out), a sum over batch and rows
};

/// All gradients in one pass: the gradient before the activation never leaves the cache. Sums over
/// rows are added in pieces of a fixed length, so that the bits do not depend on the threads.
[[nodiscard]] LinearGradients leaky_linear_gradients(const Tensor& dL_dy, const LeakyLinear& layer,
                                                     bool shares_weight, LinearWanted wanted);

}  // namespace stymo::kernels
