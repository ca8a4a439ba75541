#include "nn/layers/upsampler.h"

#include <numbers>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Upsampler::Upsampler(ParameterStore& store, const std::string& prefix, std::int64_t channels, Rng& rng)
    : detail_(store, prefix + ".detail", channels, 4 * channels,
              {.activation = Activation::leaky_relu, .gain = 1.0 / std::numbers::sqrt2}, rng) {}

Variable Upsampler::operator()(const Variable& x) const {
    if (x.rank() != 4) fail<ShapeError>("upsampler: expected an image (batch, height, width, channels), got ", x.shape());
    const std::int64_t channels = x.shape(3);
    const Variable detail = detail_(x);
    // Channel 4c + k of the sum is detail plus x's channel c, whatever the sub-pixel k.
    const Variable summed = reshape(detail, {-1, channels, 4}) + reshape(x, {-1, channels, 1});
    return blur(pixel_shuffle(reshape(summed, detail.shape())));
}

Variable double_smoothly(const Variable& image) {
    const auto twice = [&](int axis) { return static_cast<int>(2 * image.shape(axis)); };
    return blur(resize_bilinear(image, twice(1), twice(2)));
}

}  // namespace stymo
