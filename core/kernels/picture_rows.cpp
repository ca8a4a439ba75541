#include "core/kernels/picture_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stymo::kernels {
namespace {

std::array<float, 3> mirrored(const std::array<float, 3>& weights) {
    return {weights[2], weights[1], weights[0]};
}

/// Weights for pixel `index` of an axis of 2 * side.
std::array<float, 3> weights_at(const DoublingFilter& filter, std::int64_t index, std::int64_t side) {
    if (index == 0) return filter.first;
    if (index == 2 * side - 1) return mirrored(filter.first);
    return index % 2 == 0 ? filter.even : mirrored(filter.even);
}

/// Channels of even and odd pixels in turn; a number known when compiled makes moves of the copies.
template <std::int64_t known>
void interleave(float* out, const float* even, const float* odd, std::int64_t side, std::int64_t channels) {
    const std::int64_t count = known > 0 ? known : channels;
    for (std::int64_t m = 0; m < side; ++m) {
        std::copy_n(even + m * count, count, out + 2 * m * count);
        std::copy_n(odd + m * count, count, out + (2 * m + 1) * count);
    }
}

void combine(float* out, const float* before, const float* at, const float* after, const std::array<float, 3>& weights,
             std::int64_t count) {
    const float w0 = weights[0], w1 = weights[1], w2 = weights[2];
#pragma omp simd
    for (std::int64_t i = 0; i < count; ++i) out[i] = w0 * before[i] + w1 * at[i] + w2 * after[i];
}

/// By exp(r + n log 2): Cody-Waite reduction and the polynomial of the Cephes library (Moshier).
inline float sigmoid(float x) {
    const float y = std::min(std::max(-x, -80.0F), 80.0F);
    const float n = std::nearbyint(y * 1.44269504F);
    const float r = y - n * 0.693359375F + n * 2.12194440e-4F;
    float p = 1.9875691500e-4F;
    p = p * r + 1.3981999507e-3F;
    p = p * r + 8.3334519073e-3F;
    p = p * r + 4.1665795894e-2F;
    p = p * r + 1.6666665459e-1F;
    p = p * r + 5.0000001201e-1F;
    p = p * r * r + r + 1.0F;
    const auto power = std::bit_cast<float>((static_cast<std::int32_t>(n) + 127) << 23);
    return 1.0F / (1.0F + p * power);
}

}  // namespace

void double_row(float* out, float* scratch, const float* image, std::int64_t row, std::int64_t side, std::int64_t channels,
                const DoublingFilter& filter) {
    const std::int64_t length = side * channels, m = row / 2;
    const auto at = [&](std::int64_t index) { return image + std::clamp<std::int64_t>(index, 0, side - 1) * length; };
    float* mixed = scratch + channels;
    combine(mixed, at(m - 1), at(m), at(m + 1), weights_at(filter, row, side), length);
    std::copy_n(mixed, channels, scratch);
    std::copy_n(mixed + length - channels, channels, mixed + length);

    float* odd = mixed + length + channels;
    combine(odd, mixed - channels, mixed, mixed + channels, mirrored(filter.even), length);
    float* even = odd + length;
    combine(even, mixed - channels, mixed, mixed + channels, filter.even, length);
    combine(even, scratch, mixed, mixed + channels, filter.first, channels);
    float* last = odd + length - channels;
    const float* last_mixed = mixed + length - channels;
    combine(last, last_mixed - channels, last_mixed, last_mixed + channels, mirrored(filter.first), channels);
    if (channels == 3) {
        interleave<3>(out, even, odd, side, channels);
    } else {
        interleave<0>(out, even, odd, side, channels);
    }
}

void add_difference(float* to, const float* x, const float* background, std::int64_t pixels, std::int64_t channels) {
    for (std::int64_t pixel = 0; pixel < pixels; ++pixel, to += channels, x += channels) {
        for (std::int64_t c = 0; c < channels; ++c) to[c] += x[c] - background[c];
    }
}

void color_row(float* out, const float* x, const float* background, std::int64_t count) {
#pragma omp simd
    for (std::int64_t i = 0; i < count; ++i) out[i] = sigmoid(2.0F * (x[i] + background[i]));
}

void mask_row(float* out, const float* x, std::span<const float> weight, float bias, std::int64_t pixels) {
    const auto channels = static_cast<std::int64_t>(weight.size());
    const float* factor = weight.data();
    for (std::int64_t pixel = 0; pixel < pixels; ++pixel, x += channels) {
        float sum = bias;
#pragma omp simd reduction(+ : sum)
        for (std::int64_t c = 0; c < channels; ++c) sum += x[c] * factor[c];
        out[pixel] = sum;
    }
#pragma omp simd
    for (std::int64_t pixel = 0; pixel < pixels; ++pixel) out[pixel] = sigmoid(out[pixel]);
}

}  // namespace stymo::kernels
