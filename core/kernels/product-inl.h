// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_PRODUCT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_PRODUCT_INL_H
#undef STYMO_CORE_KERNELS_PRODUCT_INL_H
#else
#define STYMO_CORE_KERNELS_PRODUCT_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "core/kernels/gemm.h"

/// The innermost part of a matrix product: a block of the result in registers.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

/// Rows of a block, which is two vectors wide: as many as fit into 32 or 16 registers.
constexpr int block_rows = HWY_MAX_BYTES == 64 || HWY_ARCH_ARM_A64 ? 12 : 6;

/// A block of sums over `inner` products. The sums begin with the values in `start` and are written
/// to `sums`.
template <class T>
struct Block {
    const T* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    T* sums;
    std::int64_t sums_stride;
    const T* left;
    std::int64_t row_stride;
    std::int64_t inner_stride;
    const T* panel;
    std::int64_t panel_stride;  ///< between rows
    std::int64_t inner;
    const void* ahead;  ///< data that a later block reads: `bytes_of_prefetch` bytes of it are
                        ///< prefetched every `rows_of_prefetch` rows of the panel
};

/// When the layers of a network alternate, the next panel is not in the second-level cache. It is
/// prefetched in small parts between the products. Prefetching it all at once would delay the loads
/// of the current block.
constexpr std::int64_t rows_of_prefetch = 16;
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

template <int rows, int vectors, class T>
HWY_INLINE void multiply_rows(const Block<T>& block) {
    const simd::ScalableTag<T> tag;
    using Vector = simd::Vec<decltype(tag)>;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    Vector sums[rows][vectors];
    HWY_UNROLL(12)
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v)
            sums[row][v] = simd::LoadU(tag, block.start + row * block.start_stride + v * lanes);
    }
    // One pointer for every three rows: a single pointer would need more registers for offsets than
    // there are.
    const T* left0 = block.left;
    const T* left3 = left0 + 3 * block.row_stride;
    const T* left6 = left0 + 6 * block.row_stride;
    const T* left9 = left0 + 9 * block.row_stride;
    const T* panel = block.panel;
    const auto add_product = [&](std::int64_t left_offset, std::int64_t panel_offset) HWY_ATTR {
        Vector right[vectors];
        for (int v = 0; v < vectors; ++v)
            right[v] = simd::LoadU(tag, panel + panel_offset + v * lanes);
        HWY_UNROLL(12)
        for (int row = 0; row < rows; ++row) {
            const T* const left = row < 3 ? left0 : row < 6 ? left3 : row < 9 ? left6 : left9;
            const auto factor = simd::Set(tag, left[row % 3 * block.row_stride + left_offset]);
            for (int v = 0; v < vectors; ++v)
                sums[row][v] = simd::MulAdd(factor, right[v], sums[row][v]);
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
        const std::int64_t width = 2 * lanes;
        if (block.inner_stride == 1 && block.panel_stride == width) {
            const auto* ahead = static_cast<const char*>(block.ahead);
            for (; i + rows_of_prefetch <= block.inner; i += rows_of_prefetch) {
                prefetch_to_second_level(ahead);
                prefetch_to_second_level(ahead + bytes_of_prefetch / 2);
                ahead += bytes_of_prefetch;
                for (std::int64_t part = 0; part < rows_of_prefetch / 4; ++part) {
                    HWY_UNROLL(4)
                    for (int row = 0; row < 4; ++row) add_product(row, row * width);
                    advance_by(4, 4 * width);
                }
            }
        }
    }
    for (; i < block.inner; ++i) {
        add_product(0, 0);
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

template <int vectors, class T>
HWY_INLINE void multiply_block(int rows, const Block<T>& block) {
    switch (rows) {
        case block_rows: multiply_rows<block_rows, vectors>(block); return;
        case 4: multiply_rows<4, vectors>(block); return;
        case 2: multiply_rows<2, vectors>(block); return;
        case 1: multiply_rows<1, vectors>(block); return;
        default: break;
    }
    if constexpr (block_rows > 8) multiply_rows<8, vectors>(block);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
