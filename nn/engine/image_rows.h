#pragma once

#include <array>
#include <cstdint>
#include <span>

/// Operations on rows of the images and masks that are summed over the render blocks. All functions
/// run on the calling thread.
namespace stymo::kernels {

/// A linear upsampling with the same weights on both axes and clamped edges. `even` has the weights
/// of the pixels before, at and after m for pixel 2 m of the upsampled axis; mirrored, they belong
/// to pixel 2 m + 1. `first` has the weights of the first pixel and, mirrored, of the last one.
struct UpsampleFilter {
    std::array<float, 3> even;
    std::array<float, 3> first;
};
inline constexpr UpsampleFilter bilinear_upsample{{0.25F, 0.75F, 0.0F}, {0.0F, 1.0F, 0.0F}};
/// Bilinear, then [1,2,1]/4 with mirrored border (reference: upsample_smoothly).
inline constexpr UpsampleFilter smooth_upsample{{0.3125F, 0.625F, 0.0625F}, {0.0F, 0.875F, 0.125F}};

/// Upsamples columns [begin, end) of an image (side, side, channels) for row `row` of the upsampled
/// image -> out (2 (end - begin), channels). `scratch` has room for (end - begin + 2) * channels
/// numbers.
void upsample_row(float* out, float* scratch, const float* image, std::int64_t row,
                  std::int64_t begin, std::int64_t end, std::int64_t side, std::int64_t channels,
                  const UpsampleFilter& filter);

/// to (pixels, channels) += x - background (channels)
void add_difference(float* to, const float* x, const float* background, std::int64_t pixels,
                    std::int64_t channels);

/// Final colours in [0, 1]: out = (1 + tanh(x + background)) / 2, with an error of about 1e-7. Not
/// a number where the sum is not finite; so is the mask.
void color_row(float* out, const float* x, const float* background, std::int64_t count);
/// Final mask in [0, 1] of x (pixels, channels): out = sigmoid(x . weight + bias), with an error of
/// about 1e-7.
void mask_row(float* out, const float* x, std::span<const float> weight, float bias,
              std::int64_t pixels);

}  // namespace stymo::kernels
