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
    double initial_weight_scale =
        1.0;  ///< initial deviation of the weights, relative to the equalised one
    double initial_bias = 0.0;
    /// Factor on weight and bias. 1 / sqrt(2) cancels StyleGAN2's gain of the leaky ReLU, which
    /// commutes with scaling.
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
    /// Creates `prefix`.weight and `prefix`.bias. The weights depend on the generator's state and
    /// on the name alone, not on the random numbers of other layers.
    Linear(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out,
           const LinearOptions& options, Rng& rng);

    /// x (..., in) of rank 2 to 4 -> (..., out). Throws ShapeError for another last extent.
    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// The same in another order, for outputs that are groups of so many: the first one of each
    /// group, then the second one of each, and so on.
    [[nodiscard]] Variable by_group(const Variable& x, std::int64_t group) const;

    /// The weight as used, (out, in).
    [[nodiscard]] double weight_scale() const;
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
