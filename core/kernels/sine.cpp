#include "core/kernels/sine.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/kernels/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/sine.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/kernels/sine-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

/// Whole vectors; false if some number is beyond the limit or not a number.
template <bool with_sines, bool with_cosines>
HWY_INLINE bool sine_cosine_vectors(const float* x, float* sines, float* cosines,
                                    std::int64_t count) {
    const FloatTag tag;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    // The sum of squares detects numbers beyond the limit with one instruction for each vector.
    auto squares = simd::Zero(tag);
    for (std::int64_t i = 0; i < count; i += lanes) {
        const auto in = simd::LoadU(tag, x + i);
        squares = simd::MulAdd(in, in, squares);
        const auto turns = reduce_half_turns(in);
        if constexpr (with_sines) simd::StoreU(vector_sine(turns), tag, sines + i);
        if constexpr (with_cosines) simd::StoreU(vector_cosine(turns), tag, cosines + i);
    }
    return simd::AllTrue(tag,
                         simd::Le(squares, simd::Set(tag, vector_sine_limit * vector_sine_limit)));
}

template <bool with_sines, bool with_cosines>
void sine_cosine_block(const float* x, float* sines, float* cosines, std::int64_t count) {
    if (sine_cosine_vectors<with_sines, with_cosines>(x, sines, cosines, count)) return;
    for (std::int64_t i = 0; i < count; ++i) {
        if (std::abs(x[i]) <= vector_sine_limit) continue;
        if constexpr (with_sines) sines[i] = std::sin(x[i]);
        if constexpr (with_cosines) cosines[i] = std::cos(x[i]);
    }
}

template <bool with_sines, bool with_cosines>
void sine_cosine_blocks(const float* x, float* sines, float* cosines, std::int64_t count) {
    constexpr std::int64_t block = 256;
    constexpr std::int64_t most_lanes = HWY_MAX_BYTES / sizeof(float);
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(FloatTag()));
    const std::int64_t whole = count / lanes * lanes, rest = count - whole;
    const auto at = [](float* to, std::int64_t i) { return to == nullptr ? nullptr : to + i; };
    for (std::int64_t i = 0; i < whole; i += block)
        sine_cosine_block<with_sines, with_cosines>(x + i, at(sines, i), at(cosines, i),
                                                    std::min(block, whole - i));
    if (rest == 0) return;
    std::array<float, most_lanes> in{}, sine{}, cosine{};
    std::copy_n(x + whole, rest, in.data());
    sine_cosine_block<with_sines, with_cosines>(in.data(), sine.data(), cosine.data(), lanes);
    if constexpr (with_sines) std::copy_n(sine.data(), rest, sines + whole);
    if constexpr (with_cosines) std::copy_n(cosine.data(), rest, cosines + whole);
}

void float_sine_cosine(const float* x, float* sines, float* cosines, std::int64_t count) {
    if (cosines == nullptr) {
        sine_cosine_blocks<true, false>(x, sines, cosines, count);
    } else if (sines == nullptr) {
        sine_cosine_blocks<false, true>(x, sines, cosines, count);
    } else {
        sine_cosine_blocks<true, true>(x, sines, cosines, count);
    }
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(float_sine_cosine);

void sine_cosine(const float* x, float* sines, float* cosines, std::int64_t count) {
    HWY_DYNAMIC_DISPATCH(float_sine_cosine)(x, sines, cosines, count);
}

void sine_cosine(const double* x, double* sines, double* cosines, std::int64_t count) {
    for (std::int64_t i = 0; sines != nullptr && i < count; ++i) sines[i] = std::sin(x[i]);
    for (std::int64_t i = 0; cosines != nullptr && i < count; ++i) cosines[i] = std::cos(x[i]);
}

}  // namespace stymo::kernels
#endif
