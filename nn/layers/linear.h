#pragma once

#include <cstdint>
#include <string>

#include "core/ops/linalg.h"
#include "core/rng.h"
#include "nn/parameter_store.h"

namespace stymo {

struct LinearOptions {
    Activation activation = Activation::none;
    double learning_rate_multiplier = 1.0;
    /// Initial standard deviation of the weights, relative to that of equalised weights.
    double initial_weight_scale = 1.0;
    double initial_bias = 0.0;
    /// Factor on weight and bias. 1 / sqrt(2) cancels StyleGAN2's gain of the leaky ReLU, which
    /// commutes with positive factors.
    double gain = 1.0;
};

/// A pointwise layer as one product and one sum: activation(x weight^T + bias). All scales and
/// modulations are folded into weight and bias.
struct FoldedLayer {
    Tensor weight;  ///< (out, in)
    Tensor bias;    ///< (out)
    Activation activation = Activation::none;
};

/// Fully connected layer or 1x1 convolution with equalised learning rate (StyleGAN2's EqualLinear):
/// the stored weight (out, in) is N(0, 1) / multiplier and is scaled by multiplier / sqrt(in) when
/// used, the bias (out) by the multiplier.
class Linear {
public:
    /// Creates `prefix`.weight and `prefix`.bias. The initial weights depend only on the state of
    /// `rng` and on the name, not on the random numbers of other layers.
    Linear(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out,
           const LinearOptions& options, Rng& rng);

    /// x (..., in) of rank 2 to 4 -> (..., out). Throws ShapeError for another last extent.
    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// The same with reordered outputs. Consecutive outputs form groups of `group`; the result has
    /// the first output of each group, then the second of each, and so on.
    [[nodiscard]] Variable by_group(const Variable& x, std::int64_t group) const;

    /// Factor from the stored weight to the weight as used.
    [[nodiscard]] double weight_scale() const;
    /// The weight as used, (out, in).
    [[nodiscard]] Variable effective_weight() const;
    /// The bias as used, (out).
    [[nodiscard]] Variable effective_bias() const;
    [[nodiscard]] FoldedLayer folded() const;
    [[nodiscard]] std::int64_t inputs() const { return weight_.variable().shape(1); }
    [[nodiscard]] std::int64_t outputs() const { return weight_.variable().shape(0); }
    /// Multiply-adds for one row of the input.
    [[nodiscard]] std::int64_t multiply_adds() const { return weight_.variable().value().size(); }

private:
    [[nodiscard]] Variable apply(const Variable& x, const Variable& weight,
                                 const Variable& bias) const;

    Parameter weight_;
    Parameter bias_;
    LinearOptions options_;
};

}  // namespace stymo
