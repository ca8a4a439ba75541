#include "nn/optim/schedule.h"

#include <cmath>

namespace stymo {

double ema_decay(std::int64_t batch, double half_life_images) {
    if (half_life_images <= 0.0) return 0.0;
    return std::pow(0.5, static_cast<double>(batch) / half_life_images);
}

}  // namespace stymo
