// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_PRODUCT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_PRODUCT_INL_H
#undef STYMO_CORE_KERNELS_PRODUCT_INL_H
#else
#define STYMO_CORE_KERNELS_PRODUCT_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <type_traits>

#include "core/kernels/float16_product.h"
#include "core/kernels/gemm.h"
#include "core/kernels/halves-inl.h"

/// The innermost part of a matrix product: a block of the result in registers.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

/// Rows of a block, which is two vectors wide: as many as fit into 32 or 16 registers.
constexpr int block_rows = HWY_MAX_BYTES == 64 || HWY_ARCH_ARM_A64 ? 12 : 6;

/// Operands of a product consist of words. Here a word is one number.
template <class T>
struct Numbers {
    using Element = T;
    using Left = T;
    using Sum = T;
    using Tag = simd::ScalableTag<T>;
    using Vector = simd::Vec<Tag>;
    static constexpr std::int64_t word_length = 1;

    static HWY_INLINE Vector left(const T* word) { return simd::Set(Tag(), *word); }
    static HWY_INLINE Vector right(const T* words) { return simd::LoadU(Tag(), words); }
    static HWY_INLINE Vector multiply_add(Vector left, Vector right, Vector sum) {
        return simd::MulAdd(left, right, sum);
    }
};

/// A word is two BFloat16 numbers; those of the left operand are already widened to float. The dot
/// products of AVX-512-BF16 are not used: on Emerald Rapids they take four times as long as a
/// multiply-add and do the work of two.
struct Pairs {
    using Element = BFloat16;
    using Left = float;
    using Sum = float;
    using Tag = simd::ScalableTag<float>;
    using Vector = simd::Vec<Tag>;
    static constexpr std::int64_t word_length = 2;

    struct Both {
        // GCC for ARM does not compile the constructors that it declares itself for the same
        // instructions.
        HWY_INLINE Both() {}  // NOLINT(modernize-use-equals-default)
        HWY_INLINE Both(Vector first_, Vector second_) : first(first_), second(second_) {}

        Vector first;
        Vector second;
    };

    static HWY_INLINE Both left(const float* word) {
        return {simd::Set(Tag(), word[0]), simd::Set(Tag(), word[1])};
    }
    static HWY_INLINE Both right(const BFloat16* words) {
        const simd::ScalableTag<std::uint32_t> bits;
        const auto both = simd::LoadU(bits, reinterpret_cast<const std::uint32_t*>(words));
        return {simd::BitCast(Tag(), simd::ShiftLeft<16>(both)),
                simd::BitCast(Tag(), simd::And(both, simd::Set(bits, 0xFFFF0000U)))};
    }
    static HWY_INLINE Vector multiply_add(const Both& left, const Both& right, Vector sum) {
        return simd::MulAdd(left.second, right.second, simd::MulAdd(left.first, right.first, sum));
    }
};

/// A word is one Float16 number; those of the left operand are already widened to float.
struct Halves {
    using Element = Float16;
    using Left = float;
    using Sum = float;
    using Tag = simd::ScalableTag<float>;
    using Vector = simd::Vec<Tag>;
    static constexpr std::int64_t word_length = 1;

    static HWY_INLINE Vector left(const float* word) { return simd::Set(Tag(), *word); }
    static HWY_INLINE Vector right(const Float16* words) { return load_numbers(Tag(), words); }
    static HWY_INLINE Vector multiply_add(Vector left, Vector right, Vector sum) {
        return simd::MulAdd(left, right, sum);
    }
};

/// A word is two Float16 numbers, for the processor's half-precision products. Only for blocks of
/// whole panels.
struct HalfPairs {
    using Element = Float16;
    using Left = Float16;
    using Sum = float;
    static constexpr std::int64_t word_length = 2;
};

/// A block of sums over `inner` products of words. The sums begin with the values in `start` and
/// are written to `sums`.
template <class Operands>
struct Block {
    using Element = typename Operands::Element;
    using Left = typename Operands::Left;
    using Sum = typename Operands::Sum;

    const Sum* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    Sum* sums;
    std::int64_t sums_stride;
    const Left* left;
    std::int64_t row_stride;    ///< in elements, like inner_stride
    std::int64_t inner_stride;  ///< between words
    const Element* panel;
    std::int64_t panel_stride;  ///< between words
    std::int64_t inner;
    const void* ahead;  ///< data that a later block reads: `bytes_of_prefetch` bytes of it are
                        ///< prefetched every `words_of_prefetch` words
};

/// When the layers of a network alternate, the next panel is not in the second-level cache. It is
/// prefetched in small parts between the products. Prefetching it all at once would delay the loads
/// of the current block.
constexpr std::int64_t words_of_prefetch = 16;
constexpr std::int64_t bytes_of_prefetch = 2 * 64;

HWY_INLINE void prefetch_to_second_level(const char* address) {
    __builtin_prefetch(address, 0, 2);
}

/// Advances a pointer in a way that keeps the compiler from deriving one pointer from another.
template <class T>
HWY_INLINE void advance(T*& pointer, std::int64_t distance) {
    pointer += distance;
    __asm__("" : "+r"(pointer));
}

template <class Operands, int rows, int vectors>
HWY_INLINE void multiply_block(const Block<Operands>& block) {
    const typename Operands::Tag tag;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    typename Operands::Vector sums[rows][vectors];
    HWY_UNROLL(12)
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v)
            sums[row][v] = simd::LoadU(tag, block.start + row * block.start_stride + v * lanes);
    }
    // One pointer for every three rows: a single pointer would need more registers for offsets than
    // there are.
    const auto* left0 = block.left;
    const auto* left3 = left0 + 3 * block.row_stride;
    const auto* left6 = left0 + 6 * block.row_stride;
    const auto* left9 = left0 + 9 * block.row_stride;
    const auto* panel = block.panel;
    const auto add_word = [&](std::int64_t left_offset, std::int64_t panel_offset) HWY_ATTR {
        decltype(Operands::right(panel)) right[vectors];
        for (int v = 0; v < vectors; ++v)
            right[v] = Operands::right(panel + panel_offset + v * lanes * Operands::word_length);
        HWY_UNROLL(12)
        for (int row = 0; row < rows; ++row) {
            const auto* const left = row < 3 ? left0 : row < 6 ? left3 : row < 9 ? left6 : left9;
            const auto factor = Operands::left(left + row % 3 * block.row_stride + left_offset);
            for (int v = 0; v < vectors; ++v)
                sums[row][v] = Operands::multiply_add(factor, right[v], sums[row][v]);
        }
    };
    const auto advance_by = [&](std::int64_t left_distance, std::int64_t panel_distance) {
        advance(left0, left_distance);
        if constexpr (rows > 3) advance(left3, left_distance);
        if constexpr (rows > 6) advance(left6, left_distance);
        if constexpr (rows > 9) advance(left9, left_distance);
        panel += panel_distance;
    };
    std::int64_t i = 0;
    if constexpr (rows == block_rows) {
        constexpr std::int64_t length = Operands::word_length;
        const std::int64_t width = 2 * lanes * length;
        if (block.inner_stride == length && block.panel_stride == width) {
            const auto* ahead = static_cast<const char*>(block.ahead);
            for (; i + words_of_prefetch <= block.inner; i += words_of_prefetch) {
                prefetch_to_second_level(ahead);
                prefetch_to_second_level(ahead + bytes_of_prefetch / 2);
                ahead += bytes_of_prefetch;
                for (std::int64_t part = 0; part < words_of_prefetch / 4; ++part) {
                    HWY_UNROLL(4)
                    for (int word = 0; word < 4; ++word) add_word(word * length, word * width);
                    advance_by(4 * length, 4 * width);
                }
            }
        }
    }
    for (; i < block.inner; ++i) {
        add_word(0, 0);
        advance_by(block.inner_stride, block.panel_stride);
    }
    HWY_UNROLL(12)
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v)
            simd::StoreU(sums[row][v], tag, block.sums + row * block.sums_stride + v * lanes);
    }
}

/// Rows of the next block if `rows` remain: `block_rows`, else the largest power of two that fits.
[[nodiscard]] inline int rows_of_next_block(std::int64_t rows) {
    constexpr int heights[] = {block_rows, 8, 4, 2, 1};
    int height = 1;
    for (const int candidate : heights) {
        if (candidate <= rows && candidate <= block_rows) height = std::max(height, candidate);
    }
    return height;
}

template <class Operands, int vectors>
HWY_INLINE void multiply_block_of_numbers(int rows, const Block<Operands>& block) {
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

template <class Operands, int vectors>
HWY_INLINE void multiply_block_of(int rows, const Block<Operands>& block) {
    if constexpr (std::is_same_v<Operands, HalfPairs>) {
        multiply_float16_block(
            rows, {{block.left, block.row_stride, block.panel, block.panel_stride, block.inner},
                   block.start,
                   block.start_stride,
                   block.sums,
                   block.sums_stride});
    } else {
        multiply_block_of_numbers<Operands, vectors>(rows, block);
    }
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
