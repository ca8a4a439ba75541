#include "core/kernels/doubling.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

namespace stymo::kernels {
namespace {

inline float widened(float value) {
    return value;
}

template <class T>
inline T rounded(float value) {
    if constexpr (std::is_same_v<T, float>) {
        return value;
    } else {
        const auto bits = std::bit_cast<std::uint32_t>(value);
        return {static_cast<std::uint16_t>((bits + 0x7FFFU + ((bits >> 16) & 1U)) >> 16)};
    }
}

/// Both columns of one pixel, summed over the rows near, middle, middle with the weights 1, 2, 1: (2, channels).
template <class T>
void add_rows(float* to, const T* near_detail, const T* middle_detail, const T* middle_near_detail, const T* near_features,
              const T* middle_features, std::int64_t channels) {
#pragma omp simd
    for (std::int64_t i = 0; i < channels; ++i) {
        const float nearest = widened(near_features[i]) + 3.0F * widened(middle_features[i]);
        to[i] = nearest + widened(near_detail[i]) + 2.0F * widened(middle_detail[i]) + widened(middle_near_detail[i]);
        to[channels + i] = nearest + widened(near_detail[channels + i]) + 2.0F * widened(middle_detail[channels + i]) +
                           widened(middle_near_detail[channels + i]);
    }
}

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

template <class T>
void blur_doubled_row(T* out, float* scratch, const DetailedRow<T>& middle, const DetailedRow<T>& near, std::int64_t row,
                      std::int64_t begin, std::int64_t end, std::int64_t side, std::int64_t channels) {
    if (begin >= end) return;
    const std::int64_t first = std::max<std::int64_t>(begin - 1, 0) / 2, last = std::min(end / 2, side - 1);
    // The half of a doubled pixel that lies at this row, and the half that its neighbours' rows show.
    const std::int64_t here = row % 2 * 2 * channels, there = 2 * channels - here;
    float* columns = scratch + channels;  // column 2 * first of the doubled row
    for (std::int64_t pixel = first; pixel <= last; ++pixel) {
        const T* middle_detail = middle.detail + (pixel - middle.begin) * 4 * channels;
        add_rows(columns + (pixel - first) * 2 * channels, near.detail + (pixel - near.begin) * 4 * channels + there,
                 middle_detail + here, middle_detail + there, near.features + (pixel - near.begin) * channels,
                 middle.features + (pixel - middle.begin) * channels, channels);
    }
    if (begin == 0) std::copy_n(columns + channels, channels, scratch);
    if (end == 2 * side)
        std::copy_n(columns + (2 * (side - first) - 2) * channels, channels, columns + 2 * (side - first) * channels);
    const float* center = columns + (begin - 2 * first) * channels;
    const std::int64_t count = (end - begin) * channels;
#pragma omp simd
    for (std::int64_t i = 0; i < count; ++i)
        out[i] = rounded<T>((center[i - channels] + 2.0F * center[i] + center[i + channels]) * 0.0625F);
}

template void blur_doubled_row(float*, float*, const DetailedRow<float>&, const DetailedRow<float>&, std::int64_t, std::int64_t,
                               std::int64_t, std::int64_t, std::int64_t);
template void blur_doubled_row(BFloat16*, float*, const DetailedRow<BFloat16>&, const DetailedRow<BFloat16>&, std::int64_t,
                               std::int64_t, std::int64_t, std::int64_t, std::int64_t);

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

void narrow(float* out, const float* x, std::int64_t count) {
    std::copy_n(x, count, out);
}

void narrow(BFloat16* out, const float* x, std::int64_t count) {
    for (std::int64_t i = 0; i < count; ++i) out[i] = rounded<BFloat16>(x[i]);
}

}  // namespace stymo::kernels
