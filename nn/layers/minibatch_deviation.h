#pragma once

#include <cstdint>

#include "core/autograd/variable.h"

namespace stymo {

/// StyleGAN2's minibatch standard deviation, which shows a discriminator how much the images of a
/// batch differ: x (B, H, W, C) -> (B, H, W, C + 1). The new channel is constant within each group
/// of G = `group_size` images. It is the standard deviation over the group, sqrt(variance + 1e-8)
/// with the population variance, averaged over pixels and channels. Images i, i + B / G, i + 2 B /
/// G, ... form a group. Throws ShapeError if the group size does not divide B.
[[nodiscard]] Variable append_minibatch_deviation(const Variable& x, std::int64_t group_size);

}  // namespace stymo
