#include "nn/layers/modulated_linear.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/ops/activation.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {
namespace {

constexpr double demodulation_epsilon = 1e-8;
/// Relative to rows of magnitude 1. Prevents a division by zero for rows of zeros.
constexpr double least_epsilon = 1e-30;

Tensor initial_weight(std::int64_t in, std::int64_t out, const Tensor& scale, Rng draws) {
    Tensor weight = draws.normal({out, in}, 0.0, 1.0);
    return scale.defined() ? (Variable(weight) * Variable(scale)).value() : weight;
}

Tensor initial_bias(std::int64_t in, std::int64_t out, Activation activation, Rng draws) {
    if (activation != Activation::sine) return Tensor::zeros({out});
    const double bound = 1.0 / std::sqrt(static_cast<double>(in));
    return draws.uniform({out}, -bound, bound);
}

/// For each row of x (a, b, c) the reciprocal of a power of two near its largest magnitude, (a, b,
/// 1): a product with it loses no bits, and its square stays within float32's range. Magnitudes
/// below 1e-10 are not scaled, because epsilon outweighs them.
Variable row_units(const Tensor& x) {
    Tensor units(x.shape().with(2, 1), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const std::span<const T> values = x.values<T>();
        const auto row = static_cast<std::size_t>(x.shape(2));
        const std::span<T> out = units.mutable_values<T>();
        for (std::size_t i = 0; i < out.size(); ++i) {
            T largest = T(0);
            for (const T value : values.subspan(i * row, row))
                largest = std::max(largest, std::abs(value));
            constexpr int least = -33, most = 120;
            out[i] = largest > T(0)
                         ? std::ldexp(T(1), -std::clamp(std::ilogb(largest), least, most))
                         : T(1);
        }
    });
    return units;
}

Variable activate(const Variable& x, Activation activation) {
    if (activation == Activation::none) return x;
    return activation == Activation::sine ? sin(x) : leaky_relu(x, 0.2) * std::numbers::sqrt2;
}

}  // namespace

ModulatedLinear::ModulatedLinear(ParameterStore& store, const std::string& prefix, std::int64_t in,
                                 std::int64_t out, std::int64_t style_size, Activation activation,
                                 Rng& rng, const Tensor& initial_scale)
    : style_(store, prefix + ".style", style_size, in, {.initial_bias = 1.0}, rng),
      weight_(store.create(prefix + ".weight",
                           initial_weight(in, out, initial_scale, rng.split(prefix + ".weight")))),
      bias_(store.create(prefix + ".bias",
                         initial_bias(in, out, activation, rng.split(prefix + ".bias")))),
      activation_(activation),
      gain_(activation == Activation::sine ? std::numbers::sqrt2 : 1.0) {}

Variable ModulatedLinear::scales(const Variable& style) const {
    return reshape(style_(style), {style.shape(0), 1, weight_.variable().shape(1)});
}

Variable ModulatedLinear::equalised_weight() const {
    const Variable& weight = weight_.variable();
    return reshape(weight, {1, weight.shape(0), weight.shape(1)}) *
           (1.0 / std::sqrt(static_cast<double>(weight.shape(1))));
}

Variable ModulatedLinear::rows(const Variable& x, const Variable& style) const {
    const Shape& weight_shape = weight_.variable().shape();
    if (x.rank() < 3 || x.shape(-1) != weight_shape[1] || style.rank() != 2 ||
        style.shape(0) != x.shape(0))
        fail<ShapeError>("layer ", weight_.name(), " ", weight_shape, " does not fit ", x.shape(),
                         " with styles ", style.shape());
    return reshape(x, {x.shape(0), -1, weight_shape[1]});
}

Variable ModulatedLinear::effective_weight(const Variable& style) const {
    const ModulatedLayer layer = parts(style);
    return layer.weight * layer.scale * layer.demodulation;
}

ModulatedLayer ModulatedLinear::parts(const Variable& style) const {
    // Scaling allows weights and styles of any magnitude. A common factor cancels, except for its
    // effect on epsilon.
    const Variable plain_weight = equalised_weight(), plain_scale = scales(style);
    const Variable weight_units = row_units(plain_weight.value()),
                   scale_units = row_units(plain_scale.value());
    const Variable weight = plain_weight * weight_units, scale = plain_scale * scale_units;
    const Variable epsilon =
        maximum(square(transpose(weight_units)) * demodulation_epsilon * square(scale_units),
                Tensor::scalar(least_epsilon, style.dtype()));
    // One small product gives the norms, without a modulated weight per sample.
    const Variable squared_norm = matmul(square(scale), square(weight), {.transpose_b = true});
    const Variable norm = reshape(sqrt(squared_norm + epsilon), {style.shape(0), -1, 1});
    return {weight, scale, Variable(Tensor::scalar(gain_, style.dtype())) / norm, bias_.variable()};
}

FoldedLayer ModulatedLinear::folded(const Variable& style) const {
    const Shape& shape = weight_.variable().shape();
    if (style.rank() != 2 || style.shape(0) != 1)
        fail<ShapeError>("layer ", weight_.name(),
                         " is folded for the style of one face, (1, size), got ", style.shape());
    return {effective_weight(style).value().reshaped({shape[0], shape[1]}),
            bias_.variable().value(), activation_};
}

Variable ModulatedLinear::operator()(const Variable& x, const Variable& style) const {
    // There are far more pixels and points than weights, so everything is folded into one weight
    // per sample and a single pass over the pixels remains.
    const Variable in = rows(x, style);
    const Variable y = linear(in, effective_weight(style), bias_.variable(), activation_);
    return reshape(y, x.shape().with(-1, y.shape(2)));
}

Variable ModulatedLinear::reference(const Variable& x, const Variable& style) const {
    const Variable in = rows(x, style);
    const Variable weight = equalised_weight();
    const Variable scale = scales(style);
    const Variable squared_norm = matmul(square(scale), square(weight), {.transpose_b = true});
    const Variable product = matmul(in * scale, weight, {.transpose_b = true});
    const Variable y =
        activate(product * gain_ / sqrt(squared_norm + demodulation_epsilon) + bias_.variable(),
                 activation_);
    return reshape(y, x.shape().with(-1, weight.shape(1)));
}

}  // namespace stymo
