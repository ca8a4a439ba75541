#pragma once

#include <cstdint>

namespace stymo {

/// Decay of an EMA whose old values lose half of their weight in `half_life_images` images:
/// 0.5^(batch / half life). StyleGAN2 has 10,000.
[[nodiscard]] double ema_decay(std::int64_t batch, double half_life_images);

}  // namespace stymo
