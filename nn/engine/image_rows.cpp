#include "nn/engine/image_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stymo {
namespace {

/// The smallest interval that holds both.
PixelRow hull(const PixelRow& a, const PixelRow& b) {
    if (a.size() == 0) return b;
    if (b.size() == 0) return a;
    return {std::min(a.begin, b.begin), std::max(a.end, b.end), 0};
}

}  // namespace

void PixelRows::reset(std::int64_t side) {
    rows_.assign(static_cast<std::size_t>(side), {});
    pixels_ = 0;
}

void PixelRows::set(std::int64_t row, std::int64_t begin, std::int64_t end) {
    PixelRow& to = rows_[static_cast<std::size_t>(row)];
    to = begin < end ? PixelRow{std::max<std::int64_t>(begin, 0), std::min(end, side()), pixels_}
                     : PixelRow{0, 0, pixels_};
    pixels_ += to.size();
}

void PixelRows::set_nonzero(std::span<const std::uint8_t> pixels) {
    reset(side());
    for (std::int64_t row = 0; row < side(); ++row) {
        const auto in_row = pixels.subspan(static_cast<std::size_t>(row * side()),
                                           static_cast<std::size_t>(side()));
        const auto occupied = [](std::uint8_t pixel) { return pixel != 0; };
        const auto first = std::ranges::find_if(in_row, occupied);
        const auto last = std::find_if(in_row.rbegin(), in_row.rend(), occupied);
        set(row, first - in_row.begin(), in_row.rend() - last);
    }
}

void PixelRows::set_reached(const PixelRows& rows) {
    reset(2 * rows.side());
    for (std::int64_t row = 0; row < side(); ++row) {
        const std::int64_t near =
            std::clamp<std::int64_t>(row % 2 == 0 ? row / 2 - 1 : row / 2 + 1, 0, rows.side() - 1);
        const PixelRow both = hull(rows[row / 2], rows[near]);
        if (both.size() == 0) {
            set(row, 0, 0);
        } else {
            set(row, 2 * both.begin - 1, 2 * both.end + 1);
        }
    }
}

void PixelRows::set_read(const PixelRows& rows) {
    reset(rows.side());
    for (std::int64_t row = 0; row < side(); ++row) {
        PixelRow all = rows[row];
        if (row > 0) all = hull(all, rows[row - 1]);
        if (row + 1 < side()) all = hull(all, rows[row + 1]);
        if (all.size() == 0) {
            set(row, 0, 0);
        } else {
            set(row, all.begin - 1, all.end + 1);
        }
    }
}

void PixelRows::set_upsampled(const PixelRows& below, const PixelRows& rows) {
    reset(rows.side());
    for (std::int64_t row = 0; row < side(); ++row) {
        PixelRow all = below[row / 2];
        for (const std::int64_t y : {row / 2 - 1, row / 2 + 1}) {
            if (y >= 0 && y < below.side()) all = hull(all, below[y]);
        }
        if (all.size() > 0) all = {2 * (all.begin - 1), 2 * (all.end + 1), 0};
        all = hull(all, rows[row]);
        set(row, all.begin / 2 * 2, (all.end + 1) / 2 * 2);
    }
}

}  // namespace stymo

namespace stymo::kernels {
namespace {

constexpr std::int64_t colors = 3;

std::array<float, 3> mirrored(const std::array<float, 3>& weights) {
    return {weights[2], weights[1], weights[0]};
}

/// Weights for pixel `index` of an axis of 2 * side.
std::array<float, 3> weights_at(const UpsampleFilter& filter, std::int64_t index,
                                std::int64_t side) {
    if (index == 0) return filter.first;
    if (index == 2 * side - 1) return mirrored(filter.first);
    return index % 2 == 0 ? filter.even : mirrored(filter.even);
}

void combine(float* out, const float* before, const float* at, const float* after,
             const std::array<float, 3>& weights, std::int64_t count) {
    const float w0 = weights[0], w1 = weights[1], w2 = weights[2];
#pragma omp simd
    for (std::int64_t i = 0; i < count; ++i) out[i] = w0 * before[i] + w1 * at[i] + w2 * after[i];
}

/// Three channels do not fill a vector. Each pixel is written as four numbers, and the next pixel
/// overwrites the fourth.
void upsample_colors(float* out, const float* x, std::int64_t pixels,
                     const UpsampleFilter& filter) {
    constexpr std::int64_t wide = colors + 1;
    const auto [before, at, after] = filter.even;
    const float* const last = x + (pixels - 1) * colors;
    for (; x < last; x += colors, out += 2 * colors) {
        std::array<float, wide> even, odd;
        for (std::size_t c = 0; c < even.size(); ++c) {
            const float left = x[static_cast<std::int64_t>(c) - colors], center = at * x[c],
                        right = x[c + colors];
            even[c] = before * left + center + after * right;
            odd[c] = after * left + center + before * right;
        }
        std::copy_n(even.data(), wide, out);
        std::copy_n(odd.data(), wide, out + colors);
    }
    combine(out, last - colors, last, last + colors, filter.even, colors);
    combine(out + colors, last - colors, last, last + colors, mirrored(filter.even), colors);
}

/// Computes the exponential as exp(r + n log 2), with Cody-Waite reduction and the polynomial of
/// the Cephes library (Moshier).
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

void upsample_row(float* out, float* scratch, const float* image, std::int64_t row,
                  std::int64_t begin, std::int64_t end, std::int64_t side, std::int64_t channels,
                  const UpsampleFilter& filter) {
    const std::int64_t m = row / 2, length = (end - begin) * channels;
    const auto at = [&](std::int64_t y) {
        return image + (std::clamp<std::int64_t>(y, 0, side - 1) * side + begin) * channels;
    };
    const float *before = at(m - 1), *center = at(m), *after = at(m + 1);
    // One more pixel on both sides, if there is one.
    const std::int64_t left = begin > 0 ? -channels : 0, right = end < side ? channels : 0;
    float* mixed = scratch + channels;
    combine(mixed + left, before + left, center + left, after + left, weights_at(filter, row, side),
            length - left + right);
    if (left == 0) std::copy_n(mixed, channels, scratch);
    if (right == 0) std::copy_n(mixed + length - channels, channels, mixed + length);

    if (channels == colors) {
        upsample_colors(out, mixed, end - begin, filter);
    } else {
        for (std::int64_t i = 0; i < length; i += channels) {
            combine(out + 2 * i, mixed + i - channels, mixed + i, mixed + i + channels, filter.even,
                    channels);
            combine(out + 2 * i + channels, mixed + i - channels, mixed + i, mixed + i + channels,
                    mirrored(filter.even), channels);
        }
    }
    if (begin == 0) combine(out, scratch, mixed, mixed + channels, filter.first, channels);
    const float* last = mixed + length - channels;
    if (end == side)
        combine(out + 2 * length - channels, last - channels, last, last + channels,
                mirrored(filter.first), channels);
}

void add_difference(float* to, const float* x, const float* background, std::int64_t pixels,
                    std::int64_t channels) {
    for (std::int64_t pixel = 0; pixel < pixels; ++pixel, to += channels, x += channels) {
        for (std::int64_t c = 0; c < channels; ++c) to[c] += x[c] - background[c];
    }
}

void color_row(float* out, const float* x, const float* background, std::int64_t count) {
    // An infinite sum has overflowed, and 0 times it is not a number.
#pragma omp simd
    for (std::int64_t i = 0; i < count; ++i) {
        const float sum = x[i] + background[i];
        out[i] = sigmoid(2.0F * sum) + 0.0F * sum;
    }
}

void mask_row(float* out, const float* x, std::span<const float> weight, float bias,
              std::int64_t pixels) {
    const auto channels = static_cast<std::int64_t>(weight.size());
    const float* factor = weight.data();
    for (std::int64_t pixel = 0; pixel < pixels; ++pixel, x += channels) {
        float sum = bias;
#pragma omp simd reduction(+ : sum)
        for (std::int64_t c = 0; c < channels; ++c) sum += x[c] * factor[c];
        out[pixel] = sum;
    }
#pragma omp simd
    for (std::int64_t pixel = 0; pixel < pixels; ++pixel)
        out[pixel] = sigmoid(out[pixel]) + 0.0F * out[pixel];
}

}  // namespace stymo::kernels
