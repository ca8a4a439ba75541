#pragma once

#include "core/tensor.h"

namespace stymo::kernels {

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
