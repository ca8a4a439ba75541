// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_HALVES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_HALVES_INL_H
#undef STYMO_CORE_KERNELS_HALVES_INL_H
#else
#define STYMO_CORE_KERNELS_HALVES_INL_H
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "core/kernels/gemm.h"

/// Loads and stores of float32 vectors from and to memory with 16-bit numbers. Every instruction
/// set rounds to nearest, ties to even.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE simd::Vec<D> load_numbers(D tag, const simd::TFromD<D>* from) {
    return simd::LoadU(tag, from);
}

template <class D>
HWY_INLINE simd::Vec<D> load_numbers(D tag, const BFloat16* from) {
    const simd::Rebind<std::uint16_t, D> halves;
    const simd::RebindToUnsigned<D> words;
    const auto bits = simd::LoadU(halves, reinterpret_cast<const std::uint16_t*>(from));
    return simd::BitCast(tag, simd::ShiftLeft<16>(simd::PromoteTo(words, bits)));
}

/// `x` has a 16-bit number in each of its 32-bit lanes. The destination is void*: a pointer to the
/// number's struct type would make a vector store look like an access to a single number.
template <class D>
HWY_INLINE void store_words(D /*tag*/, simd::Vec<D> x, void* to) {
    const simd::Rebind<std::uint16_t, D> halves;
    const simd::RebindToSigned<D> integers;
    simd::StoreU(simd::DemoteTo(halves, simd::BitCast(integers, x)), halves,
                 static_cast<std::uint16_t*>(to));
}

template <class D>
HWY_INLINE void store_numbers(D tag, simd::Vec<D> x, simd::TFromD<D>* to) {
    simd::StoreU(x, tag, to);
}

template <class D>
HWY_INLINE void store_numbers(D tag, simd::Vec<D> x, BFloat16* to) {
    (void)tag;
    const simd::RebindToUnsigned<D> words;
    const auto bits = simd::BitCast(words, x);
    const auto odd = simd::And(simd::ShiftRight<16>(bits), simd::Set(words, 1));
    const auto rounded =
        simd::ShiftRight<16>(simd::Add(bits, simd::Add(odd, simd::Set(words, 0x7FFF))));
    const auto quiet = simd::ShiftRight<16>(simd::Or(bits, simd::Set(words, 0x400000)));
    store_words(words, simd::IfThenElse(simd::RebindMask(words, simd::IsNaN(x)), quiet, rounded),
                to);
}

#if HWY_TARGET == HWY_EMU128 || HWY_TARGET == HWY_SCALAR || \
    (HWY_ARCH_X86 && (HWY_TARGET >= HWY_SSE4 || defined(HWY_DISABLE_F16C)))

/// On these targets Highway's own conversions truncate, and make infinity finite.
template <class D>
HWY_INLINE simd::Vec<D> load_numbers(D tag, const Float16* from) {
    const simd::Rebind<std::uint16_t, D> halves;
    const simd::RebindToSigned<D> integers;
    const auto bits = simd::BitCast(
        integers,
        simd::PromoteTo(simd::RebindToUnsigned<D>(),
                        simd::LoadU(halves, reinterpret_cast<const std::uint16_t*>(from))));
    const auto size = simd::And(bits, simd::Set(integers, 0x7FFF));
    // Converts the exponent's bias from 15 to 127; infinity and NaN have the largest exponent.
    const auto normal = simd::Add(simd::ShiftLeft<13>(size), simd::Set(integers, 0x38000000));
    const auto special = simd::Or(normal, simd::Set(integers, 0x7F800000));
    const auto subnormal =
        simd::BitCast(integers, simd::Mul(simd::ConvertTo(tag, size), simd::Set(tag, 0x1p-24F)));
    const auto finite =
        simd::IfThenElse(simd::Lt(size, simd::Set(integers, 0x400)), subnormal, normal);
    const auto number =
        simd::IfThenElse(simd::Lt(size, simd::Set(integers, 0x7C00)), finite, special);
    const auto sign = simd::ShiftLeft<16>(simd::Sub(bits, size));
    return simd::BitCast(tag, simd::Or(number, sign));
}

template <class D>
HWY_INLINE void store_numbers(D tag, simd::Vec<D> x, Float16* to) {
    const simd::RebindToUnsigned<D> words;
    const auto bits = simd::BitCast(words, x);
    const auto sign = simd::And(bits, simd::Set(words, 0x80000000U));
    const auto size = simd::Xor(bits, sign);
    const auto odd = simd::And(simd::ShiftRight<13>(size), simd::Set(words, 1));
    const auto rounded = simd::Add(size, simd::Add(odd, simd::Set(words, 0xFFF)));
    // Converts the exponent's bias from 127 to 15.
    const auto normal =
        simd::Min(simd::ShiftRight<13>(simd::Sub(rounded, simd::Set(words, 0x38000000U))),
                  simd::Set(words, 0x7C00U));
    // Near 0.5 the last bit of a float32 has the value of the smallest Float16, 2^-24.
    const auto half = simd::Set(tag, 0.5F);
    const auto subnormal =
        simd::Sub(simd::BitCast(words, simd::Add(simd::BitCast(tag, size), half)),
                  simd::BitCast(words, half));
    const auto is_normal =
        simd::RebindMask(words, simd::Ge(simd::BitCast(tag, size), simd::Set(tag, 0x1p-14F)));
    const auto number = simd::IfThenElse(is_normal, normal, subnormal);
    const auto nan = simd::Set(words, 0x7E00U);
    const auto result = simd::IfThenElse(simd::RebindMask(words, simd::IsNaN(x)), nan, number);
    store_words(words, simd::Or(result, simd::ShiftRight<16>(sign)), to);
}

#else

template <class D>
HWY_INLINE simd::Vec<D> load_numbers(D tag, const Float16* from) {
    const simd::Rebind<hwy::float16_t, D> halves;
    return simd::PromoteTo(tag, simd::LoadU(halves, reinterpret_cast<const hwy::float16_t*>(from)));
}

template <class D>
HWY_INLINE void store_numbers(D tag, simd::Vec<D> x, Float16* to) {
    (void)tag;
    const simd::Rebind<hwy::float16_t, D> halves;
    simd::StoreU(simd::DemoteTo(halves, x), halves, reinterpret_cast<hwy::float16_t*>(to));
}

#endif

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
