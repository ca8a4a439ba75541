#include "nn/layers/discriminator_block.h"

#include <array>
#include <numbers>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Variable append_minibatch_deviation(const Variable& x, std::int64_t group_size) {
    if (x.rank() != 4 || group_size < 1 || x.shape(0) % group_size != 0)
        fail<ShapeError>("minibatch standard deviation: ", x.shape(),
                         " is not a number of groups of ", group_size, " images");
    constexpr double epsilon = 1e-8;
    const std::int64_t groups = x.shape(0) / group_size;
    const Variable members = reshape(x, {group_size, groups, -1});
    const Variable variance = mean(square(members - mean(members, {0})), {0});
    const Variable deviation = mean(sqrt(variance + epsilon), {2});
    const Variable channel = broadcast_to(deviation, {group_size, groups, x.shape(1) * x.shape(2)});
    return concat({x, reshape(channel, x.shape().with(3, 1))}, 3);
}

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
