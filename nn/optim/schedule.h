#pragma once

#include <cstdint>

#include "nn/optim/adam.h"

namespace stymo {

/// initial * factor^count: the paper's 0.98 for each epoch of training and 0.99 for each step of fitting.
[[nodiscard]] double exponential_decay(double initial, double factor, std::int64_t count);

/// Decay for which `half_life_images` images halve the weight of an old value: 0.5^(batch / half life). StyleGAN2 has 10,000.
[[nodiscard]] double ema_decay(std::int64_t batch, double half_life_images);

struct AdamSettings {
    double learning_rate = 0.0;
    AdamOptions options;
};

/// What Adam needs when every `interval` steps come with one more, for a lazy regularizer, so that together they act as
/// `interval` of the given steps: the rate times c and betas^c with c = interval / (interval + 1) (StyleGAN2, appendix B).
[[nodiscard]] AdamSettings with_lazy_regularization(const AdamSettings& settings, std::int64_t interval);

}  // namespace stymo
