// Operands for matrix tiles: float32 numbers become one or two parts of bfloat16, in the order in
// which TDPBF16PS reads them.
//
// Parts. A bfloat16 number is the upper half of a float32 number. One part is made by the
// processor's own conversion. Two parts are made with integers, because the remainder needs the
// first part as a float32 number again: adding 0x8000 and clearing the lower half rounds to nearest
// (ties away from zero) and leaves the number where a float32 subtraction can use it. The remainder
// x - upper is exact. It is rounded in the same way and is the second part. Why two parts suffice
// is said in tile_product.cpp.
//
// Order. The instruction sums pairs: a row of the left tile is 16 pairs of consecutive inner
// elements, and a row of the right tile has, for each of 16 columns, the pair of elements of two
// consecutive inner rows. Left rows that are contiguous therefore keep their order, and right rows
// that are contiguous are interleaved two by two. Operands that are contiguous along the other
// dimension are first made into pairs, each of which is one 32-bit number, and a 16 x 16 matrix of
// such numbers is transposed in registers.
//
// Products thus never need a transposed copy of an operand, which the gradients of a linear layer
// would otherwise make. Inner elements and right columns beyond the extents become zeros, so that
// the product works with whole steps.

#include "core/kernels/tile_product.h"

#if defined(__x86_64__) && defined(__linux__)
#include <immintrin.h>

#include <algorithm>
#include <array>

#include "core/parallel.h"

/// Instructions that every processor with matrix tiles has.
#define STYMO_SPLITS __attribute__((target("avx512bw,avx512vl,avx512bf16")))
#define STYMO_SPLITS_INLINE \
    __attribute__((target("avx512bw,avx512vl,avx512bf16"), always_inline)) inline
#endif

namespace stymo::kernels {

#if defined(__x86_64__) && defined(__linux__)

namespace {

/// Thirty-two numbers of BFloat16 in each part.
template <int parts>
struct Split {
    __m512i part[parts];
};

/// Indices into two vectors of 32 16-bit numbers.
using Order = std::array<std::int16_t, 32>;
constexpr Order order(auto index_at) {
    Order indices{};
    for (int i = 0; i < 32; ++i)
        indices[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(index_at(i));
    return indices;
}
/// The upper halves of two vectors' 32-bit numbers, one vector after the other.
alignas(64) constexpr Order upper_halves = order([](int i) { return 2 * i + 1; });
/// Interleaves the numbers of a vector's two halves.
alignas(64) constexpr Order alternating = order([](int i) { return i / 2 + i % 2 * 16; });

/// Upper and lower part of sixteen numbers, each in the upper halves of 32 bits.
struct Halves {
    __m512i upper;
    __m512i lower;
};

STYMO_SPLITS_INLINE Halves halves_of(__m512 x) {
    const __m512i half = _mm512_set1_epi32(0x8000);
    const __m512i upper =
        _mm512_and_si512(_mm512_add_epi32(_mm512_castps_si512(x), half),
                         _mm512_set1_epi32(static_cast<std::int32_t>(0xFFFF0000U)));
    const __m512 rest = _mm512_sub_ps(x, _mm512_castsi512_ps(upper));
    return {upper, _mm512_add_epi32(_mm512_castps_si512(rest), half)};
}

/// Interleaves the upper halves of a and b.
STYMO_SPLITS_INLINE __m512i pairs_of(__m512i a, __m512i b) {
    return _mm512_mask_blend_epi16(0xAAAAAAAA, _mm512_maskz_srli_epi32(0xFFFF, a, 16), b);
}

STYMO_SPLITS_INLINE __m512i rounded(__m512 first, __m512 second) {
    return reinterpret_cast<__m512i>(_mm512_cvtne2ps_pbh(second, first));
}

/// Sixteen numbers, then sixteen others.
template <int parts>
STYMO_SPLITS_INLINE Split<parts> in_sequence(__m512 first, __m512 second) {
    if constexpr (parts == 1) {
        return {{rounded(first, second)}};
    } else {
        const __m512i halves = _mm512_load_si512(upper_halves.data());
        const Halves a = halves_of(first), b = halves_of(second);
        return {{_mm512_permutex2var_epi16(a.upper, halves, b.upper),
                 _mm512_permutex2var_epi16(a.lower, halves, b.lower)}};
    }
}

/// Sixteen numbers interleaved with sixteen others.
template <int parts>
STYMO_SPLITS_INLINE Split<parts> by_turns(__m512 first, __m512 second) {
    if constexpr (parts == 1) {
        return {{_mm512_permutexvar_epi16(_mm512_load_si512(alternating.data()),
                                          rounded(first, second))}};
    } else {
        const Halves a = halves_of(first), b = halves_of(second);
        return {{pairs_of(a.upper, b.upper), pairs_of(a.lower, b.lower)}};
    }
}

/// Writes rows that begin at `to` in a step's first part.
template <int parts>
STYMO_SPLITS_INLINE void store(BFloat16* to, const Split<parts>& split) {
    for (int part = 0; part < parts; ++part)
        _mm512_store_si512(to + part * tile_step_size, split.part[part]);
}

STYMO_SPLITS_INLINE __mmask16 first_lanes(std::int64_t count) {
    return static_cast<__mmask16>((1U << std::clamp<std::int64_t>(count, 0, 16)) - 1);
}

/// Rows whose elements are contiguous.
template <int parts>
STYMO_SPLITS void split_rows(BFloat16* to, const float* from, std::int64_t row_stride,
                             std::int64_t rows, std::int64_t k) {
    const __mmask16 first = first_lanes(k % tile_step), second = first_lanes(k % tile_step - 16);
    for (std::int64_t row = 0; row < rows; ++row, from += row_stride, to += tile_step) {
        const float* source = from;
        BFloat16* target = to;
        for (const float* const last = from + k / tile_step * tile_step; source < last;
             source += tile_step, target += parts * tile_step_size)
            store(target,
                  in_sequence<parts>(_mm512_loadu_ps(source), _mm512_loadu_ps(source + 16)));
        if (k % tile_step != 0)
            store(target, in_sequence<parts>(_mm512_maskz_loadu_ps(first, source),
                                             _mm512_maskz_loadu_ps(second, source + 16)));
    }
}

/// A 16x16 matrix of pairs, transposed.
STYMO_SPLITS_INLINE void transpose(__m512i* rows) {
    __m512i a[16], b[16];
#pragma GCC unroll 8
    for (int i = 0; i < 16; i += 2) {
        a[i] = _mm512_maskz_unpacklo_epi32(0xFFFF, rows[i], rows[i + 1]);
        a[i + 1] = _mm512_maskz_unpackhi_epi32(0xFFFF, rows[i], rows[i + 1]);
    }
#pragma GCC unroll 4
    for (int i = 0; i < 16; i += 4) {
        for (int j = 0; j < 2; ++j) {
            b[i + 2 * j] = _mm512_maskz_unpacklo_epi64(0xFF, a[i + j], a[i + j + 2]);
            b[i + 2 * j + 1] = _mm512_maskz_unpackhi_epi64(0xFF, a[i + j], a[i + j + 2]);
        }
    }
    // b[4 i + j] holds column 4 l + j of rows 4 i to 4 i + 3 in its lane l.
#pragma GCC unroll 4
    for (int j = 0; j < 4; ++j) {
        const __m512i low01 = _mm512_maskz_shuffle_i32x4(0xFFFF, b[j], b[4 + j], 0x44),
                      high01 = _mm512_maskz_shuffle_i32x4(0xFFFF, b[j], b[4 + j], 0xEE),
                      low23 = _mm512_maskz_shuffle_i32x4(0xFFFF, b[8 + j], b[12 + j], 0x44),
                      high23 = _mm512_maskz_shuffle_i32x4(0xFFFF, b[8 + j], b[12 + j], 0xEE);
        rows[j] = _mm512_maskz_shuffle_i32x4(0xFFFF, low01, low23, 0x88);
        rows[4 + j] = _mm512_maskz_shuffle_i32x4(0xFFFF, low01, low23, 0xDD);
        rows[8 + j] = _mm512_maskz_shuffle_i32x4(0xFFFF, high01, high23, 0x88);
        rows[12 + j] = _mm512_maskz_shuffle_i32x4(0xFFFF, high01, high23, 0xDD);
    }
}

/// Sixteen rows of pairs, which become the columns of a tile.
template <int parts>
struct PairRows {
    __m512i rows[parts][16];

    STYMO_SPLITS_INLINE void set(int row, const Split<parts>& split) {
        for (int part = 0; part < parts; ++part) rows[part][row] = split.part[part];
    }
    STYMO_SPLITS_INLINE void store_transposed(BFloat16* to) {
        for (int part = 0; part < parts; ++part) {
            transpose(rows[part]);
            for (int row = 0; row < 16; ++row)
                _mm512_store_si512(to + part * tile_step_size + row * tile_step, rows[part][row]);
        }
    }
};

/// Rows of the transpose are contiguous, `inner_stride` apart.
template <int parts>
STYMO_SPLITS void split_columns(BFloat16* to, const float* from, std::int64_t inner_stride,
                                std::int64_t rows, std::int64_t k) {
    for (std::int64_t i = 0; i < k; i += tile_step, to += parts * tile_step_size) {
        for (std::int64_t first = 0; first < rows; first += tile_height) {
            const __mmask16 lanes = first_lanes(rows - first);
            const float* const source = from + i * inner_stride + first;
            PairRows<parts> pairs;
            for (int pair = 0; pair < 16; ++pair) {
                const std::int64_t row = 2 * pair;
                const __mmask16 upper = i + row < k ? lanes : 0,
                                lower = i + row + 1 < k ? lanes : 0;
                const float* const at = source + row * inner_stride;
                pairs.set(pair, by_turns<parts>(_mm512_maskz_loadu_ps(upper, at),
                                                _mm512_maskz_loadu_ps(lower, at + inner_stride)));
            }
            pairs.store_transposed(to + first / tile_height * tile_size);
        }
    }
}

/// The right operand, whose columns lie side by side.
template <int parts>
STYMO_SPLITS void split_pairs_of_rows(BFloat16* to, const float* from, std::int64_t inner_stride,
                                      std::int64_t k, std::int64_t columns) {
    const __mmask16 left = first_lanes(columns), right = first_lanes(columns - 16);
    for (std::int64_t row = 0; row < chunk_count(k, tile_step) * tile_step; row += 2) {
        BFloat16* const target =
            to + row / tile_step * parts * tile_step_size + row % tile_step / 2 * tile_step;
        const __mmask16 first = row < k ? 0xFFFF : 0, second = row + 1 < k ? 0xFFFF : 0;
        const float* const source = from + row * inner_stride;
        const float* const below = source + inner_stride;
        store(target, by_turns<parts>(_mm512_maskz_loadu_ps(first & left, source),
                                      _mm512_maskz_loadu_ps(second & left, below)));
        store(target + tile_size,
              by_turns<parts>(_mm512_maskz_loadu_ps(first & right, source + 16),
                              _mm512_maskz_loadu_ps(second & right, below + 16)));
    }
}

/// The right operand, each of whose columns is contiguous.
template <int parts>
STYMO_SPLITS void split_pairs_of_columns(BFloat16* to, const float* from,
                                         std::int64_t column_stride, std::int64_t k,
                                         std::int64_t columns) {
    for (std::int64_t i = 0; i < k; i += tile_step, to += parts * tile_step_size) {
        const __mmask16 first = first_lanes(k - i), second = first_lanes(k - i - 16);
        for (std::int64_t tile = 0; tile < 2; ++tile) {
            PairRows<parts> pairs;
            for (int j = 0; j < 16; ++j) {
                const std::int64_t column = tile * 16 + j;
                const bool exists = column < columns;
                const float* const source = from + column * column_stride + i;
                pairs.set(
                    j, in_sequence<parts>(_mm512_maskz_loadu_ps(exists ? first : 0, source),
                                          _mm512_maskz_loadu_ps(exists ? second : 0, source + 16)));
            }
            pairs.store_transposed(to + tile * tile_size);
        }
    }
}

template <int parts>
void split_left_into(BFloat16* to, const LeftMatrix<float>& left, std::int64_t rows,
                     std::int64_t k) {
    if (left.inner_stride == 1) {
        split_rows<parts>(to, left.data, left.row_stride, rows, k);
    } else {
        split_columns<parts>(to, left.data, left.inner_stride, rows, k);
    }
}

template <int parts>
void split_right_into(BFloat16* to, const float* from, std::int64_t k, std::int64_t columns,
                      std::int64_t inner_stride, std::int64_t column_stride) {
    if (column_stride == 1) {
        split_pairs_of_rows<parts>(to, from, inner_stride, k, columns);
    } else {
        split_pairs_of_columns<parts>(to, from, column_stride, k, columns);
    }
}

}  // namespace

void split_left(int parts, BFloat16* to, const LeftMatrix<float>& left, std::int64_t rows,
                std::int64_t k) {
    (parts == 1 ? split_left_into<1> : split_left_into<2>)(to, left, rows, k);
}

void split_right(int parts, BFloat16* to, const float* from, std::int64_t k, std::int64_t columns,
                 std::int64_t inner_stride, std::int64_t column_stride) {
    (parts == 1 ? split_right_into<1> : split_right_into<2>)(to, from, k, columns, inner_stride,
                                                             column_stride);
}

#else

void split_left(int, BFloat16*, const LeftMatrix<float>&, std::int64_t, std::int64_t) {}
void split_right(int, BFloat16*, const float*, std::int64_t, std::int64_t, std::int64_t,
                 std::int64_t) {}

#endif

}  // namespace stymo::kernels
