#include "nn/engine/colors.h"

#include <algorithm>

#ifdef __aarch64__
// The kernels use arrays of vectors, which need vectors of fixed length.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#else
// No kernel uses the instructions that this set adds to AVX3.
#define HWY_DISABLED_TARGETS HWY_AVX3_DL
#endif
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/engine/colors.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/kernels/halves-inl.h"

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

HWY_INLINE float as_float(float x) {
    return x;
}
HWY_INLINE float as_float(BFloat16 x) {
    return widened(x);
}
HWY_INLINE float as_float(Float16 x) {
    return widened(x);
}

/// Colours of pixels with this many channels.
template <class T>
struct ColorSum {
    float* to;
    const T* x;
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
template <class T>
HWY_INLINE void add_colors_of_four(const ColorSum<T>& sum, std::int64_t pixel,
                                   std::int64_t channels_in_vectors) {
    const simd::ScalableTag<float> tag;
    const simd::CappedTag<float, 4> four;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    const T* x = sum.x + pixel * sum.channels;
    simd::Vec<decltype(tag)> sums[3][4];
    for (auto& color : sums) {
        for (auto& of_pixel : color) of_pixel = simd::Zero(tag);
    }
    for (std::int64_t channel = 0; channel < channels_in_vectors; channel += lanes) {
        simd::Vec<decltype(tag)> features[4];
        for (int p = 0; p < 4; ++p) features[p] = load_numbers(tag, x + p * sum.channels + channel);
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

template <class T>
HWY_INLINE void add_colors_of_one(const ColorSum<T>& sum, std::int64_t pixel,
                                  std::int64_t first_channel, bool with_background) {
    const T* x = sum.x + pixel * sum.channels;
    for (std::int64_t c = 0; c < 3; ++c) {
        float color = with_background ? -sum.background[c] : 0.0F;
        for (std::int64_t channel = first_channel; channel < sum.channels; ++channel)
            color += as_float(x[channel]) * sum.weight[c * sum.channels + channel];
        sum.to[3 * pixel + c] += color;
    }
}

template <class T>
HWY_INLINE void add_all_colors(const ColorSum<T>& sum, std::int64_t pixels) {
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

void add_colors_float(float* to, const float* x, const float* weight, const float* background,
                      std::int64_t pixels, std::int64_t channels) {
    add_all_colors(ColorSum<float>{to, x, weight, background, channels}, pixels);
}
void add_colors_bfloat16(float* to, const BFloat16* x, const float* weight, const float* background,
                         std::int64_t pixels, std::int64_t channels) {
    add_all_colors(ColorSum<BFloat16>{to, x, weight, background, channels}, pixels);
}
void add_colors_float16(float* to, const Float16* x, const float* weight, const float* background,
                        std::int64_t pixels, std::int64_t channels) {
    add_all_colors(ColorSum<Float16>{to, x, weight, background, channels}, pixels);
}

/// Converts whole vectors to another type, and the rest one by one with the same results.
template <class From, class To>
HWY_INLINE void convert(To* out, const From* x, std::int64_t count) {
    const simd::ScalableTag<float> tag;
    const simd::CappedTag<float, 1> one;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    std::int64_t i = 0;
    for (; i + lanes <= count; i += lanes) store_numbers(tag, load_numbers(tag, x + i), out + i);
    for (; i < count; ++i) store_numbers(one, load_numbers(one, x + i), out + i);
}

void narrow_to_bfloat16(BFloat16* out, const float* x, std::int64_t count) {
    convert(out, x, count);
}
void narrow_to_float16(Float16* out, const float* x, std::int64_t count) {
    convert(out, x, count);
}
void widen_bfloat16(float* out, const BFloat16* x, std::int64_t count) {
    convert(out, x, count);
}
void widen_float16(float* out, const Float16* x, std::int64_t count) {
    convert(out, x, count);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(add_colors_float);
HWY_EXPORT(add_colors_bfloat16);
HWY_EXPORT(add_colors_float16);
HWY_EXPORT(narrow_to_bfloat16);
HWY_EXPORT(narrow_to_float16);
HWY_EXPORT(widen_bfloat16);
HWY_EXPORT(widen_float16);

void add_colors(float* to, const float* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(add_colors_float)(to, x, weight, background, pixels, channels);
}
void add_colors(float* to, const BFloat16* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(add_colors_bfloat16)(to, x, weight, background, pixels, channels);
}
void add_colors(float* to, const Float16* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(add_colors_float16)(to, x, weight, background, pixels, channels);
}

void narrow(float* out, const float* x, std::int64_t count) {
    std::copy_n(x, count, out);
}
void narrow(BFloat16* out, const float* x, std::int64_t count) {
    HWY_DYNAMIC_DISPATCH(narrow_to_bfloat16)(out, x, count);
}
void narrow(Float16* out, const float* x, std::int64_t count) {
    HWY_DYNAMIC_DISPATCH(narrow_to_float16)(out, x, count);
}

void widen(float* out, const float* x, std::int64_t count) {
    std::copy_n(x, count, out);
}
void widen(float* out, const BFloat16* x, std::int64_t count) {
    HWY_DYNAMIC_DISPATCH(widen_bfloat16)(out, x, count);
}
void widen(float* out, const Float16* x, std::int64_t count) {
    HWY_DYNAMIC_DISPATCH(widen_float16)(out, x, count);
}

}  // namespace stymo::kernels
#endif
