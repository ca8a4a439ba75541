#include "nn/engine/colors.h"

#include "core/kernels/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/engine/colors.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

/// Colours of pixels with this many channels.
struct ColorSum {
    float* to;
    const float* x;
    const float* weight;
    const float* background;
    std::int64_t channels;
};

#if HWY_TARGET != HWY_SCALAR
/// Horizontal sums of four vectors: within each block of four lanes, lane i has the sum of the
/// block's lanes of vector i.
template <class D, class V>
HWY_INLINE V sums_in_blocks(D tag, V a, V b, V c, V d) {
    const simd::RepartitionToWide<D> wide;
    const auto ab = simd::BitCast(
        wide, simd::Add(simd::InterleaveLower(tag, a, b), simd::InterleaveUpper(tag, a, b)));
    const auto cd = simd::BitCast(
        wide, simd::Add(simd::InterleaveLower(tag, c, d), simd::InterleaveUpper(tag, c, d)));
    return simd::Add(simd::BitCast(tag, simd::InterleaveLower(wide, ab, cd)),
                     simd::BitCast(tag, simd::InterleaveUpper(wide, ab, cd)));
}

template <class D, class V>
HWY_INLINE auto sum_of_blocks(D, V x) {
    if constexpr (simd::MaxLanes(D()) <= 4) {
        return x;
    } else {
        const simd::Half<D> half;
        return sum_of_blocks(half, simd::Add(simd::LowerHalf(half, x), simd::UpperHalf(half, x)));
    }
}

/// Colours of four pixels, from the channels that fill whole vectors.
HWY_INLINE void add_colors_of_four(const ColorSum& sum, std::int64_t pixel,
                                   std::int64_t channels_in_vectors) {
    const simd::ScalableTag<float> tag;
    const simd::CappedTag<float, 4> four;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    const float* x = sum.x + pixel * sum.channels;
    simd::Vec<decltype(tag)> sums[3][4];
    for (auto& color : sums) {
        for (auto& of_pixel : color) of_pixel = simd::Zero(tag);
    }
    for (std::int64_t channel = 0; channel < channels_in_vectors; channel += lanes) {
        simd::Vec<decltype(tag)> features[4];
        for (int p = 0; p < 4; ++p) features[p] = simd::LoadU(tag, x + p * sum.channels + channel);
        for (int c = 0; c < 3; ++c) {
            const auto weight = simd::LoadU(tag, sum.weight + c * sum.channels + channel);
            for (int p = 0; p < 4; ++p) sums[c][p] = simd::MulAdd(weight, features[p], sums[c][p]);
        }
    }
    simd::Vec<decltype(four)> colors[3], present[3];
    float* to = sum.to + 3 * pixel;
    simd::LoadInterleaved3(four, to, present[0], present[1], present[2]);
    for (int c = 0; c < 3; ++c) {
        const auto blocks = sums_in_blocks(tag, sums[c][0], sums[c][1], sums[c][2], sums[c][3]);
        const auto difference =
            simd::Sub(sum_of_blocks(tag, blocks), simd::Set(four, sum.background[c]));
        colors[c] = simd::Add(present[c], difference);
    }
    simd::StoreInterleaved3(colors[0], colors[1], colors[2], four, to);
}
#endif

HWY_INLINE void add_colors_of_one(const ColorSum& sum, std::int64_t pixel,
                                  std::int64_t first_channel, bool with_background) {
    const float* x = sum.x + pixel * sum.channels;
    for (std::int64_t c = 0; c < 3; ++c) {
        float color = with_background ? -sum.background[c] : 0.0F;
        for (std::int64_t channel = first_channel; channel < sum.channels; ++channel)
            color += x[channel] * sum.weight[c * sum.channels + channel];
        sum.to[3 * pixel + c] += color;
    }
}

HWY_INLINE void add_all(const ColorSum& sum, std::int64_t pixels) {
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(simd::ScalableTag<float>()));
    const std::int64_t in_vectors = sum.channels / lanes * lanes;
    std::int64_t in_fours = 0;
#if HWY_TARGET != HWY_SCALAR
    for (; in_fours + 4 <= pixels; in_fours += 4) add_colors_of_four(sum, in_fours, in_vectors);
#endif
    for (std::int64_t pixel = 0; pixel < in_fours && in_vectors < sum.channels; ++pixel)
        add_colors_of_one(sum, pixel, in_vectors, false);
    for (std::int64_t pixel = in_fours; pixel < pixels; ++pixel)
        add_colors_of_one(sum, pixel, 0, true);
}

void add_all_colors(float* to, const float* x, const float* weight, const float* background,
                    std::int64_t pixels, std::int64_t channels) {
    add_all(ColorSum{to, x, weight, background, channels}, pixels);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(add_all_colors);

void add_colors(float* to, const float* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(add_all_colors)(to, x, weight, background, pixels, channels);
}

}  // namespace stymo::kernels
#endif
