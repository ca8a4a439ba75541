#pragma once

#include <string>

#include "core/ops/conv.h"
#include "core/rng.h"
#include "nn/parameter_store.h"

namespace stymo {

/// Initialisation of the weights, and their scale when they are used.
enum class WeightScaling {
    plain,  ///< used as stored, for published weights; He initialisation unless `initial_deviation`
            ///< is given
    equalised,  ///< standard normal, multiplied by 1 / sqrt(fan in) at each use (StyleGAN), so that
                ///< one learning rate suits every layer
};

struct ConvLayerOptions {
    std::int64_t kernel = 3;
    int stride = 1;
    int padding = 1;
    int groups = 1;
    bool bias = true;  ///< starts at 0
    WeightScaling scaling = WeightScaling::plain;
    double initial_deviation = 0.0;  ///< of plain weights; 0: sqrt(2 / fan in) (He)
    /// Factor on weight and bias. It can replace a factor before or after a leaky ReLU, which
    /// commutes with positive factors.
    double gain = 1.0;
};

/// Two-dimensional convolution, (B, H, W, in) -> (B, H', W', out) with the sizes of conv2d.
class ConvLayer {
public:
    /// Creates `name`.weight (out, kernel, kernel, in / groups) and, if requested, `name`.bias
    /// (out). The initial weights depend only on the state of `rng` and on the name. Throws
    /// ValueError if the groups do not divide both channel counts.
    ConvLayer(ParameterStore& store, const std::string& name, std::int64_t in, std::int64_t out,
              const ConvLayerOptions& options, Rng& rng);

    /// Applies a leaky ReLU of this slope after the convolution; 1: no activation.
    [[nodiscard]] Variable operator()(const Variable& x, double slope = 1.0) const;
    /// The convolution followed by output * `scale` (out) + `shift` (out), like a batch norm in
    /// inference mode. It scales the weight, which is cheaper than scaling the image. Only for a
    /// layer without bias.
    [[nodiscard]] Variable scaled(const Variable& x, const Variable& scale,
                                  const Variable& shift) const;

    [[nodiscard]] const Parameter& weight() const { return weight_; }
    /// Undefined for a layer without bias.
    [[nodiscard]] const Parameter& bias() const { return bias_; }

private:
    [[nodiscard]] Variable apply(const Variable& x, const Variable& weight, const Variable& bias,
                                 double slope) const;

    Parameter weight_;
    Parameter bias_;
    Conv2dOptions options_;
    double weight_gain_ = 1.0;
    double bias_gain_ = 1.0;
};

}  // namespace stymo
