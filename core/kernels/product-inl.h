// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_PRODUCT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_PRODUCT_INL_H
#undef STYMO_CORE_KERNELS_PRODUCT_INL_H
#else
#define STYMO_CORE_KERNELS_PRODUCT_INL_H
#endif

#include <hwy/highway.h>

#include <cstring>

#include "core/kernels/gemm.h"

/// The innermost part of a product: a block of the result in registers.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

/// Rows of a block, two vectors wide: as many as 32 or 16 registers hold.
constexpr int block_rows = HWY_MAX_BYTES == 64 || HWY_ARCH_ARM_A64 ? 12 : 6;

/// Operands of a product come in words: one number, or two of BFloat16.
template <class T>
struct Numbers {
    using Element = T;
    using Sum = T;
    using Tag = simd::ScalableTag<T>;
    using Vector = simd::Vec<Tag>;
    static constexpr std::int64_t word_length = 1;

    static HWY_INLINE Vector left(const T* word) { return simd::Set(Tag(), *word); }
    static HWY_INLINE Vector right(const T* words) { return simd::Load(Tag(), words); }
    static HWY_INLINE Vector multiply_add(Vector left, Vector right, Vector sum) { return simd::MulAdd(left, right, sum); }
};

/// AVX-512-BF16, about which Highway 1.0 does not know.
inline bool has_bfloat16_dot_product() {
#if HWY_ARCH_X86 && HWY_MAX_BYTES == 64
    return __builtin_cpu_supports("avx512bf16") != 0;
#else
    return false;
#endif
}

/// `dot_product`: the processor has the instruction, which rounds as the two multiply-adds do. Denormals count as zero there.
template <bool dot_product>
struct Pairs {
    using Element = BFloat16;
    using Sum = float;
    using Tag = simd::ScalableTag<float>;
    using Vector = simd::Vec<Tag>;
    using Words = simd::ScalableTag<std::uint32_t>;
    using WordVector = simd::Vec<Words>;
    static constexpr std::int64_t word_length = 2;

    static HWY_INLINE WordVector left(const BFloat16* word) {
        std::uint32_t both = 0;
        std::memcpy(&both, word, sizeof(both));
        return simd::Set(Words(), both);
    }
    static HWY_INLINE WordVector right(const BFloat16* words) {
        return simd::Load(Words(), reinterpret_cast<const std::uint32_t*>(words));
    }
    static HWY_INLINE Vector multiply_add(WordVector left, WordVector right, Vector sum) {
#if HWY_ARCH_X86 && HWY_MAX_BYTES == 64
        if constexpr (dot_product) {
            __asm__("vdpbf16ps %2, %1, %0" : "+v"(sum.raw) : "v"(left.raw), "v"(right.raw));
            return sum;
        }
#endif
        const auto upper = simd::Set(Words(), 0xFFFF0000U);
        const Tag tag;
        sum = simd::MulAdd(simd::BitCast(tag, simd::And(left, upper)), simd::BitCast(tag, simd::And(right, upper)), sum);
        return simd::MulAdd(simd::BitCast(tag, simd::ShiftLeft<16>(left)), simd::BitCast(tag, simd::ShiftLeft<16>(right)), sum);
    }
};

/// Sums of `inner` products of words, added to what stands in `start` and written to `sums`.
template <class Operands>
struct Block {
    using Element = typename Operands::Element;
    using Sum = typename Operands::Sum;

    const Sum* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    Sum* sums;
    std::int64_t sums_stride;
    const Element* left;
    std::int64_t row_stride;    ///< in elements, as is the next
    std::int64_t inner_stride;  ///< between words
    const Element* panel;
    std::int64_t inner;
};

/// Without letting the compiler derive one pointer from another one.
template <class T>
HWY_INLINE void advance(T*& pointer, std::int64_t distance) {
    pointer += distance;
    __asm__("" : "+r"(pointer));
}

template <class Operands, int rows, int vectors>
HWY_INLINE void multiply_block(const Block<Operands>& block) {
    const typename Operands::Tag tag;
    const std::int64_t lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    typename Operands::Vector sums[rows][vectors];
    HWY_UNROLL(12)
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v) sums[row][v] = simd::LoadU(tag, block.start + row * block.start_stride + v * lanes);
    }
    // A pointer for three rows each: one for all of them needs more registers for distances than there are.
    const auto* left0 = block.left;
    const auto* left3 = left0 + 3 * block.row_stride;
    const auto* left6 = left0 + 6 * block.row_stride;
    const auto* left9 = left0 + 9 * block.row_stride;
    const auto* panel = block.panel;
    for (std::int64_t i = 0; i < block.inner; ++i) {
        decltype(Operands::right(panel)) right[vectors];
        for (int v = 0; v < vectors; ++v) right[v] = Operands::right(panel + v * lanes * Operands::word_length);
        HWY_UNROLL(12)
        for (int row = 0; row < rows; ++row) {
            const auto* const left = row < 3 ? left0 : row < 6 ? left3 : row < 9 ? left6 : left9;
            const auto factor = Operands::left(left + row % 3 * block.row_stride);
            for (int v = 0; v < vectors; ++v) sums[row][v] = Operands::multiply_add(factor, right[v], sums[row][v]);
        }
        advance(left0, block.inner_stride);
        if constexpr (rows > 3) advance(left3, block.inner_stride);
        if constexpr (rows > 6) advance(left6, block.inner_stride);
        if constexpr (rows > 9) advance(left9, block.inner_stride);
        panel += 2 * lanes * Operands::word_length;
    }
    HWY_UNROLL(12)
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v) simd::StoreU(sums[row][v], tag, block.sums + row * block.sums_stride + v * lanes);
    }
}

/// Blocks of the most rows, then of powers of two: what is left of a power of two is one of them.
[[nodiscard]] inline int rows_of_next_block(std::int64_t rows) {
    constexpr int heights[] = {block_rows, 8, 4, 2, 1};
    int height = 1;
    for (const int candidate : heights) {
        if (candidate <= rows && candidate <= block_rows) height = std::max(height, candidate);
    }
    return height;
}

template <class Operands, int vectors>
HWY_INLINE void multiply_block_of(int rows, const Block<Operands>& block) {
    switch (rows) {
        case block_rows:
            multiply_block<Operands, block_rows, vectors>(block);
            return;
        case 4:
            multiply_block<Operands, 4, vectors>(block);
            return;
        case 2:
            multiply_block<Operands, 2, vectors>(block);
            return;
        case 1:
            multiply_block<Operands, 1, vectors>(block);
            return;
        default:
            break;
    }
    if constexpr (block_rows > 8) multiply_block<Operands, 8, vectors>(block);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
