// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_SINE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_SINE_INL_H
#undef STYMO_CORE_KERNELS_SINE_INL_H
#else
#define STYMO_CORE_KERNELS_SINE_INL_H
#endif

#include <hwy/highway.h>

/// The vector sine and cosine of float32.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

using FloatTag = simd::ScalableTag<float>;
using FloatVector = simd::Vec<FloatTag>;
using BitsTag = simd::ScalableTag<std::uint32_t>;
using BitsVector = simd::Vec<BitsTag>;

/// Largest |x| for which the reduction below keeps float32 accuracy: up to here, products of an
/// integer and the upper part of pi are exact.
constexpr float vector_sine_limit = 8192.0F;

/// x = n pi + remainder, |remainder| <= pi / 2. Sine and cosine change sign with every n.
struct HalfTurns {
    FloatVector remainder;
    BitsVector sign;  ///< the sign bit
};

HWY_INLINE HalfTurns reduce_half_turns(FloatVector x) {
    const FloatTag tag;
    // Adding 1.5 * 2^23 rounds to an integer, which is then in the lowest bits.
    const auto shift = simd::Set(tag, 12582912.0F);
    const auto shifted = simd::MulAdd(x, simd::Set(tag, 0.318309886F), shift);
    const auto count = simd::Sub(shifted, shift);
    // Cody and Waite's reduction with pi in parts. With fused multiply-adds the first part needs no
    // trailing zero bits.
    auto remainder = x;
    if constexpr (HWY_NATIVE_FMA) {
        remainder = simd::NegMulAdd(count, simd::Set(tag, 3.14159274F), remainder);
        remainder = simd::NegMulAdd(count, simd::Set(tag, -8.74227766e-8F), remainder);
    } else {
        remainder = simd::NegMulAdd(count, simd::Set(tag, 3.140625F), remainder);
        remainder = simd::NegMulAdd(count, simd::Set(tag, 9.67502593994140625e-4F), remainder);
        remainder = simd::NegMulAdd(count, simd::Set(tag, 1.50995799097837e-7F), remainder);
    }
    return {remainder, simd::ShiftLeft<31>(simd::BitCast(BitsTag(), shifted))};
}

HWY_INLINE FloatVector flip_sign(BitsVector sign, FloatVector x) {
    return simd::BitCast(FloatTag(), simd::Xor(sign, simd::BitCast(BitsTag(), x)));
}

/// Absolute error below 3e-7 for |x| <= vector_sine_limit. The minimax polynomial on [-pi/2, pi/2]
/// has an error of 5e-9.
HWY_INLINE FloatVector vector_sine(const HalfTurns& x) {
    const FloatTag tag;
    const auto r = x.remainder;
    const auto r2 = simd::Mul(r, r);
    auto p = simd::MulAdd(r2, simd::Set(tag, 2.6000243e-6F), simd::Set(tag, -1.9806602e-4F));
    p = simd::MulAdd(p, r2, simd::Set(tag, 8.333017e-3F));
    p = simd::MulAdd(p, r2, simd::Set(tag, -0.16666657F));
    return flip_sign(x.sign, simd::MulAdd(p, simd::Mul(r, r2), r));
}

/// The same; the polynomial has an error of 5e-8.
HWY_INLINE FloatVector vector_cosine(const HalfTurns& x) {
    const FloatTag tag;
    const auto r2 = simd::Mul(x.remainder, x.remainder);
    auto p = simd::MulAdd(r2, simd::Set(tag, 2.3194072e-5F), simd::Set(tag, -1.3855915e-3F));
    p = simd::MulAdd(p, r2, simd::Set(tag, 4.166399e-2F));
    p = simd::MulAdd(p, r2, simd::Set(tag, -0.4999993F));
    return flip_sign(x.sign, simd::MulAdd(p, r2, simd::Set(tag, 1.0F)));
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
