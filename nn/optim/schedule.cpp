#include "nn/optim/schedule.h"

#include <cmath>

#include "core/error.h"

namespace stymo {

double exponential_decay(double initial, double factor, std::int64_t count) {
    return initial * std::pow(factor, static_cast<double>(count));
}

double ema_decay(std::int64_t batch, double half_life_images) {
    if (half_life_images <= 0.0) return 0.0;
    return std::pow(0.5, static_cast<double>(batch) / half_life_images);
}

AdamSettings with_lazy_regularization(const AdamSettings& settings, std::int64_t interval) {
    if (interval < 1) fail<ValueError>("the interval of a lazy regularizer must be at least 1, got ", interval);
    const double share = static_cast<double>(interval) / static_cast<double>(interval + 1);
    return {settings.learning_rate * share,
            {std::pow(settings.options.beta1, share), std::pow(settings.options.beta2, share), settings.options.epsilon}};
}

}  // namespace stymo
