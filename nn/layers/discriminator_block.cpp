#include "nn/layers/discriminator_block.h"

#include <array>
#include <numbers>

#include "core/ops/elementwise.h"
#include "core/ops/resample.h"

namespace stymo {
namespace {

constexpr std::array<double, 4> blur_filter{0.125, 0.375, 0.375, 0.125};

}  // namespace

DiscriminatorBlock::DiscriminatorBlock(ParameterStore& store, const std::string& prefix,
                                       std::int64_t in, std::int64_t out, Rng& rng)
    : conv0_(store, prefix + ".conv0", in, in,
             {.scaling = WeightScaling::equalised, .gain = std::numbers::sqrt2}, rng),
      // The division by sqrt(2) at the end cancels the gain of this layer, so only the skip needs a
      // factor.
      conv1_(store, prefix + ".conv1", in, out,
             {.stride = 2, .padding = 0, .scaling = WeightScaling::equalised}, rng),
      skip_(store, prefix + ".skip", in, out,
            {.kernel = 1,
             .padding = 0,
             .bias = false,
             .scaling = WeightScaling::equalised,
             .gain = 1.0 / std::numbers::sqrt2},
            rng) {}

LayerMemory DiscriminatorBlock::memory(std::int64_t in, std::int64_t out, std::int64_t side) {
    // Saved are the inputs of both convolutions (the blurred one counts twice) and of the skip.
    return {(13 * in + out) * side * side / 4, 4 * in * side * side};
}

Variable DiscriminatorBlock::operator()(const Variable& x) const {
    // A 1x1 convolution with a stride reads only some of the pixels, so the blur need not compute
    // the others.
    const Variable skip = skip_(upfirdn2d(x, blur_filter, 1, 2, 1, 1));
    const Variable blurred = upfirdn2d(conv0_(x, 0.2), blur_filter, 1, 1, 2, 2);
    return conv1_(blurred, 0.2) + skip;
}

}  // namespace stymo
