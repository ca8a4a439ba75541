#include "nn/layers/upsampler.h"

#include <numbers>

#include "core/error.h"
#include "core/ops/blur_upsampled.h"
#include "core/ops/resample.h"

namespace stymo {

Upsampler::Upsampler(ParameterStore& store, const std::string& prefix, std::int64_t channels,
                     Rng& rng)
    : detail_(store, prefix + ".detail", channels, 4 * channels,
              {.activation = Activation::leaky_relu, .gain = 1.0 / std::numbers::sqrt2}, rng) {}

Variable Upsampler::operator()(const Variable& x) const {
    if (x.rank() != 4)
        fail<ShapeError>("upsampler: expected an image (batch, height, width, channels), got ",
                         x.shape());
    return blur_upsampled(x, detail_.by_group(x, 4));
}

Variable upsample_smoothly(const Variable& image) {
    const auto twice = [&](int axis) { return static_cast<int>(2 * image.shape(axis)); };
    return blur(resize_bilinear(image, twice(1), twice(2)));
}

}  // namespace stymo
