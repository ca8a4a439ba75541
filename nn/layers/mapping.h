#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/layers/linear.h"

namespace stymo {

/// Mapping network of one code group from Z to W, which have the same size: equalised layers with
/// leaky ReLU; the last layer is linear. Unlike StyleGAN2 it has no pixel norm, because the length
/// of a code carries meaning (a neutral expression is near 0).
class Mapping {
public:
    /// Creates `prefix`.layer0 and so on. Throws ValueError for fewer than one layer.
    Mapping(ParameterStore& store, const std::string& prefix, std::int64_t size,
            std::int64_t layers, double learning_rate_multiplier, Rng& rng);

    /// (B, size) -> (B, size)
    [[nodiscard]] Variable operator()(const Variable& z) const;

private:
    std::vector<Linear> layers_;
};

}  // namespace stymo
