#pragma once

#include <cstdint>

namespace stymo {

/// Decay of an exponential moving average for one step of `batch` images: 0.5^(batch /
/// half_life_images). StyleGAN2 uses a half life of 10,000 images.
[[nodiscard]] double ema_decay(std::int64_t batch, double half_life_images);

}  // namespace stymo
