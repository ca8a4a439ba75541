#pragma once

#include <string>

#include "nn/parameter_store.h"

namespace stymo {

struct BatchNormOptions {
    bool fixed_weight = false;      ///< the weight is a constant: 1, or the value in a file
    double initial_variance = 1.0;  ///< the running variance, unless a file provides one
};

/// Batch normalisation that is always in inference mode: (x - mean) / sqrt(variance + epsilon) *
/// weight + bias with stored statistics that are never updated, because the micro-batches of
/// training are too small to estimate them. It is computed as scale * x + shift, with one pair for
/// each channel (last axis).
class BatchNorm {
public:
    static constexpr double epsilon = 1e-5;

    /// Creates `name`.weight and `name`.bias (trainable, 1 and 0), `name`.running_mean and
    /// `name`.running_variance (constants, 0 and 1, unless the options differ).
    BatchNorm(ParameterStore& store, const std::string& name, std::int64_t channels,
              const BatchNormOptions& options = {});

    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// weight / sqrt(variance + epsilon), (channels). Throws NumericError for a stored variance
    /// that is negative or not a number.
    [[nodiscard]] Variable scale() const;
    /// bias - mean * scale, (channels)
    [[nodiscard]] Variable shift(const Variable& scale) const;

    [[nodiscard]] const Parameter& weight() const { return weight_; }
    [[nodiscard]] const Parameter& bias() const { return bias_; }
    [[nodiscard]] const Parameter& running_mean() const { return running_mean_; }
    [[nodiscard]] const Parameter& running_variance() const { return running_variance_; }

private:
    Parameter weight_;
    Parameter bias_;
    Parameter running_mean_;
    Parameter running_variance_;
};

}  // namespace stymo
