#include "nn/engine/precision.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/float16_product.h"

namespace stymo {
namespace {

constexpr float largest_input = 16.0F;

bool fits_float16(const FoldedLayer& layer) {
    const std::int64_t outputs = layer.weight.shape(0), inputs = layer.weight.shape(1);
    const std::span<const float> weight = layer.weight.values<float>();
    for (std::int64_t row = 0; row < outputs; ++row) {
        float sum = 0.0F;
        for (std::int64_t i = 0; i < inputs; ++i)
            sum += std::abs(weight[static_cast<std::size_t>(row * inputs + i)]);
        // A NaN does not fit either.
        if (!(sum * largest_input <= kernels::largest_float16)) return false;
    }
    return true;
}

}  // namespace

Precision sixteen_bits_for(std::span<const FoldedLayer> layers) {
    return kernels::multiplies_float16() && std::ranges::all_of(layers, fits_float16)
               ? Precision::float16
               : Precision::bfloat16;
}

}  // namespace stymo
