#include "nn/layers/conv_layer.h"

#include <cmath>

#include "core/error.h"
#include "core/ops/activation.h"
#include "core/ops/elementwise.h"
#include "core/ops/linalg.h"
#include "core/ops/shape_ops.h"

namespace stymo {
namespace {

double initial_deviation(const ConvLayerOptions& options, double fan_in) {
    if (options.scaling == WeightScaling::equalised) return 1.0;
    return options.initial_deviation > 0.0 ? options.initial_deviation : std::sqrt(2.0 / fan_in);
}

Variable times(const Variable& x, double gain) {
    return gain == 1.0 ? x : x * gain;
}

}  // namespace

ConvLayer::ConvLayer(ParameterStore& store, const std::string& name, std::int64_t in,
                     std::int64_t out, const ConvLayerOptions& options, Rng& rng)
    : options_{options.stride, options.padding, options.groups}, bias_gain_(options.gain) {
    if (options.groups < 1 || in % options.groups != 0 || out % options.groups != 0)
        fail<ValueError>(name, ": ", options.groups, " groups do not divide ", in, " and ", out,
                         " channels");
    const Shape shape{out, options.kernel, options.kernel, in / options.groups};
    const auto fan_in = static_cast<double>(shape.product(1, 4));
    weight_gain_ = options.gain *
                   (options.scaling == WeightScaling::equalised ? 1.0 / std::sqrt(fan_in) : 1.0);
    Rng draws = rng.split(name + ".weight");
    weight_ = store.create(name + ".weight",
                           draws.normal(shape, 0.0, initial_deviation(options, fan_in)));
    if (options.bias) bias_ = store.create(name + ".bias", Tensor::zeros({out}));
}

Variable ConvLayer::operator()(const Variable& x, double slope) const {
    const Variable bias = bias_.defined() ? times(bias_.variable(), bias_gain_) : Variable();
    return apply(x, times(weight_.variable(), weight_gain_), bias, slope);
}

Variable ConvLayer::scaled(const Variable& x, const Variable& scale, const Variable& shift) const {
    if (bias_.defined())
        fail<ValueError>(bias_.name(), ": a layer with a bias cannot take a normalisation's shift");
    return apply(x, weight_.variable() * reshape(scale * weight_gain_, {-1, 1, 1, 1}), shift, 1.0);
}

Variable ConvLayer::apply(const Variable& x, const Variable& weight, const Variable& bias,
                          double slope) const {
    const std::int64_t out = weight.shape(0);
    const bool pointwise = weight.shape(1) == 1 && weight.shape(2) == 1 && options_.stride == 1 &&
                           options_.padding == 0 && options_.groups == 1;
    if (pointwise) {
        // One matrix product over all pixels, with the bias added while the result is in cache.
        const Variable pixels = reshape(x, {1, -1, x.shape(3)});
        const Variable y = reshape(linear(pixels, reshape(weight, {1, out, -1}), bias),
                                   {x.shape(0), x.shape(1), x.shape(2), out});
        return slope == 1.0 ? y : leaky_relu(y, slope);
    }
    return conv2d(x, weight, bias, slope, options_);
}

}  // namespace stymo
