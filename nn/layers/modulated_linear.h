#pragma once

#include <cstdint>
#include <string>

#include "nn/layers/linear.h"

namespace stymo {

/// The factors of a modulated layer, activation(demodulation * (weight (scale * x)) + bias). Value
/// is Variable or Tensor.
template <class Value>
struct ModulatedLayerOf {
    Value weight;        ///< (1, out, in)
    Value scale;         ///< (B, 1, in)
    Value demodulation;  ///< (B, out, 1)
    Value bias;          ///< (out)
};

using ModulatedLayer = ModulatedLayerOf<Variable>;

/// Weight-demodulated pointwise layer (StyleGAN2's modulated convolution with a 1x1 kernel; paper,
/// "modulated layer"):
///
///     s_i   = style layer (equalised, bias 1 at the start)
///     w'_oi = W_oi s_i / sqrt(in)
///     y_o   = activation(gain * sum_i w'_oi x_i / sqrt(sum_i w'_oi^2 + 1e-8) + bias_o)
///
/// W is initialised with N(0, 1). With a sine, the gain is sqrt(2), which keeps the standard
/// deviation of the sine's argument near 1 at any depth, and the bias is uniform in +-1 / sqrt(in).
/// (SIREN's factor 30 would turn the argument into noise, because demodulation cancels SIREN's
/// small weights.) With other activations the gain is 1 and the bias 0; the leaky ReLU includes a
/// factor sqrt(2).
class ModulatedLinear {
public:
    /// Creates `prefix`.weight (out, in), `prefix`.bias (out) and `prefix`.style.{weight,bias}.
    /// `initial_scale` (in) multiplies the columns of the initial weight; undefined: ones.
    ModulatedLinear(ParameterStore& store, const std::string& prefix, std::int64_t in,
                    std::int64_t out, std::int64_t style_size, Activation activation, Rng& rng,
                    const Tensor& initial_scale = {});

    /// x (B, ..., in) of rank 3 or 4, style (B, style_size) -> (B, ..., out). Throws ShapeError for
    /// shapes that do not fit.
    [[nodiscard]] Variable operator()(const Variable& x, const Variable& style) const;
    /// The layer folded for the style of one face, (1, style_size).
    [[nodiscard]] FoldedLayer folded(const Variable& style) const;
    /// The factors of the layer for these styles (B, style_size). The demodulation includes the
    /// gain.
    [[nodiscard]] ModulatedLayer parts(const Variable& style) const;
    /// The reference implementation: scales the inputs, applies one weight for all samples, and
    /// scales the outputs.
    [[nodiscard]] Variable reference(const Variable& x, const Variable& style) const;
    [[nodiscard]] std::int64_t inputs() const { return weight_.variable().shape(1); }
    [[nodiscard]] std::int64_t outputs() const { return weight_.variable().shape(0); }
    /// Multiply-adds for one row of the input.
    [[nodiscard]] std::int64_t multiply_adds() const { return weight_.variable().value().size(); }

private:
    [[nodiscard]] Variable rows(const Variable& x, const Variable& style) const;
    /// (B, 1, in)
    [[nodiscard]] Variable scales(const Variable& style) const;
    /// W / sqrt(in), (1, out, in)
    [[nodiscard]] Variable equalised_weight() const;
    /// Modulated and demodulated weight times the gain: (B, out, in)
    [[nodiscard]] Variable effective_weight(const Variable& style) const;

    Linear style_;
    Parameter weight_;
    Parameter bias_;
    Activation activation_;
    double gain_;
};

}  // namespace stymo
