#pragma once

#include <cstdint>

namespace stymo {

/// Decay for which `half_life_images` images halve the weight of an old value: 0.5^(batch / half
/// life). StyleGAN2 has 10,000.
[[nodiscard]] double ema_decay(std::int64_t batch, double half_life_images);

}  // namespace stymo
