#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/kernels/gemm.h"

/// What a real-time render block does between its products, one row at a time and on the calling thread. Activations are float
/// or BFloat16, sums float.
namespace stymo::kernels {

/// Pixels from `begin` on of one row of an image that is to be doubled.
template <class T>
struct DetailedRow {
    std::int64_t begin = 0;
    const T* features = nullptr;  ///< (pixels, channels)
    const T* detail = nullptr;    ///< (pixels, 4, channels): row i, column j of the doubled pixel at 2 i + j
};

/// Pixels [begin, end) of row `row` of blur(detail + nearest neighbour), the learnt doubling (twin: Upsampler) of an image of
/// `side` columns -> out (end - begin, channels). `middle` is the image's row row / 2; `near` is the row above it for an even
/// row, else the row below it, and `middle` itself at the image's border. Both need pixels from (begin - 1) / 2 to end / 2 within
/// the image. `scratch`: (2 side + 2) * channels numbers.
template <class T>
void blur_doubled_row(T* out, float* scratch, const DetailedRow<T>& middle, const DetailedRow<T>& near, std::int64_t row,
                      std::int64_t begin, std::int64_t end, std::int64_t side, std::int64_t channels);

/// A doubling that is linear and the same on both axes, edges clamped: weights of the pixels before, at and after m for the pixel
/// 2 m of the doubled axis and, mirrored, for 2 m + 1. The first and the last pixel have weights of their own.
struct DoublingFilter {
    std::array<float, 3> even;
    std::array<float, 3> first;
};
inline constexpr DoublingFilter bilinear_doubling{{0.25F, 0.75F, 0.0F}, {0.0F, 1.0F, 0.0F}};
/// Bilinear, then [1,2,1]/4 with mirrored border (twin: double_smoothly).
inline constexpr DoublingFilter smooth_doubling{{0.3125F, 0.625F, 0.0625F}, {0.0F, 0.875F, 0.125F}};

/// Row `row` of the doubled image (side, side, channels) -> out (2 side, channels). `scratch`: (3 side + 2) * channels numbers.
void double_row(float* out, float* scratch, const float* image, std::int64_t row, std::int64_t side, std::int64_t channels,
                const DoublingFilter& filter);

/// to (pixels, channels) += x - background (channels)
void add_difference(float* to, const float* x, const float* background, std::int64_t pixels, std::int64_t channels);

/// Channels of a picture in [0, 1]: out = (1 + tanh(x + background)) / 2, error about 1e-7.
void color_row(float* out, const float* x, const float* background, std::int64_t count);
/// Mask in [0, 1] of pixels (pixels, channels): out = sigmoid(x . weight + bias), error about 1e-7.
void mask_row(float* out, const float* x, std::span<const float> weight, float bias, std::int64_t pixels);

/// To the type of activations, rounded to nearest even.
void narrow(float* out, const float* x, std::int64_t count);
void narrow(BFloat16* out, const float* x, std::int64_t count);

}  // namespace stymo::kernels
