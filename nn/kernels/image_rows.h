#pragma once

#include <array>
#include <cstdint>
#include <span>

/// Rows of the images and masks that render blocks add up, on the calling thread.
namespace stymo::kernels {

/// A upsampling that is linear and the same on both axes, edges clamped: weights of the pixels
/// before, at and after m for the pixel 2 m of the upsampled axis and, mirrored, for 2 m + 1. The
/// first and the last pixel have weights of their own.
struct UpsampleFilter {
    std::array<float, 3> even;
    std::array<float, 3> first;
};
inline constexpr UpsampleFilter bilinear_upsample{{0.25F, 0.75F, 0.0F}, {0.0F, 1.0F, 0.0F}};
/// Bilinear, then [1,2,1]/4 with mirrored border (reference: upsample_smoothly).
inline constexpr UpsampleFilter smooth_upsample{{0.3125F, 0.625F, 0.0625F}, {0.0F, 0.875F, 0.125F}};

/// What pixels [begin, end) of an image (side, side, channels) become in row `row` of the upsampled
/// image -> out (2 (end - begin), channels). `scratch`: (end - begin + 2) * channels numbers.
void upsample_row(float* out, float* scratch, const float* image, std::int64_t row,
                  std::int64_t begin, std::int64_t end, std::int64_t side, std::int64_t channels,
                  const UpsampleFilter& filter);

/// to (pixels, channels) += x - background (channels)
void add_difference(float* to, const float* x, const float* background, std::int64_t pixels,
                    std::int64_t channels);

/// Channels of an image in [0, 1]: out = (1 + tanh(x + background)) / 2, error about 1e-7.
void color_row(float* out, const float* x, const float* background, std::int64_t count);
/// Mask in [0, 1] of pixels (pixels, channels): out = sigmoid(x . weight + bias), error about 1e-7.
void mask_row(float* out, const float* x, std::span<const float> weight, float bias,
              std::int64_t pixels);

}  // namespace stymo::kernels
