#include "core/kernels/tile_product.h"

#include "core/matmul_precision.h"
#include "core/parallel.h"

#if defined(__x86_64__) && defined(__linux__)
#include <cpuid.h>
#include <immintrin.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#endif

namespace stymo::kernels {

#if defined(__x86_64__) && defined(__linux__)

namespace {

constexpr std::int64_t tile_rows = 16;
/// Elements of a tile: 16 rows of 64 bytes.
constexpr std::int64_t tile_size = 512;

/// Asks the system to save the tiles' state, without which their instructions are illegal.
bool system_grants_tiles() {
    constexpr long request_permission = 0x1023, tile_data = 18;
    return syscall(SYS_arch_prctl, request_permission, tile_data) == 0;
}

bool processor_has_tiles() {
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0) return false;
    constexpr unsigned amx_bfloat16 = 1U << 22, amx_tile = 1U << 24;
    return (d & amx_bfloat16) != 0 && (d & amx_tile) != 0 && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512vl");
}

/// Sixteen numbers as bits: the nearest numbers of BFloat16 in the upper halves of `upper`, and
/// what they lack in those of `lower`, whose lower halves are to be ignored.
struct Split {
    __m512i upper;
    __m512i lower;
};

__attribute__((target("avx512bw,avx512vl"), always_inline)) inline Split split(__m512 x) {
    const __m512i half = _mm512_set1_epi32(0x8000);
    const __m512i upper =
        _mm512_and_si512(_mm512_add_epi32(_mm512_castps_si512(x), half),
                         _mm512_set1_epi32(static_cast<std::int32_t>(0xFFFF0000U)));
    const __m512 rest = _mm512_sub_ps(x, _mm512_castsi512_ps(upper));
    return {upper, _mm512_add_epi32(_mm512_castps_si512(rest), half)};
}

/// The upper halves of a and b by turns.
__attribute__((target("avx512bw,avx512vl"), always_inline)) inline __m512i pairs_of(__m512i a,
                                                                                    __m512i b) {
    return _mm512_mask_blend_epi16(0xAAAAAAAA, _mm512_maskz_srli_epi32(0xFFFF, a, 16), b);
}

/// Two rows of a tile of the right operand.
__attribute__((target("avx512bw,avx512vl"), always_inline)) inline void store_pairs(BFloat16* to,
                                                                                    __m512 first,
                                                                                    __m512 second) {
    const Split a = split(first), b = split(second);
    _mm512_store_si512(to, pairs_of(a.upper, b.upper));
    _mm512_store_si512(to + 2 * tile_size, pairs_of(a.lower, b.lower));
}

__attribute__((target("avx512bw,avx512vl"), always_inline)) inline __mmask16 first_lanes(
    std::int64_t count) {
    return static_cast<__mmask16>((1U << std::clamp<std::int64_t>(count, 0, 16)) - 1);
}

/// Indices of the upper halves of two vectors' numbers.
alignas(64) constexpr std::array<std::int16_t, 32> upper_halves = [] {
    std::array<std::int16_t, 32> indices{};
    for (std::size_t i = 0; i < indices.size(); ++i)
        indices[i] = static_cast<std::int16_t>(2 * i + 1);
    return indices;
}();

/// A step of one row.
__attribute__((target("avx512bw,avx512vl"), always_inline)) inline void store_step(BFloat16* to,
                                                                                   __m512 first,
                                                                                   __m512 second) {
    const __m512i order = _mm512_load_si512(upper_halves.data());
    const Split a = split(first), b = split(second);
    _mm512_store_si512(to, _mm512_permutex2var_epi16(a.upper, order, b.upper));
    _mm512_store_si512(to + 2 * tile_size, _mm512_permutex2var_epi16(a.lower, order, b.lower));
}

/// Rows whose elements are contiguous.
__attribute__((target("avx512bw,avx512vl"))) void split_rows(BFloat16* to, const float* from,
                                                             std::int64_t row_stride,
                                                             std::int64_t rows, std::int64_t k) {
    const __mmask16 first = first_lanes(k % tile_step), second = first_lanes(k % tile_step - 16);
    for (std::int64_t row = 0; row < rows; ++row, from += row_stride, to += tile_step) {
        const float* source = from;
        BFloat16* target = to;
        for (const float* const last = from + k / tile_step * tile_step; source < last;
             source += tile_step, target += tile_step_size)
            store_step(target, _mm512_loadu_ps(source), _mm512_loadu_ps(source + 16));
        if (k % tile_step != 0)
            store_step(target, _mm512_maskz_loadu_ps(first, source),
                       _mm512_maskz_loadu_ps(second, source + 16));
    }
}

/// A 16x16 matrix of pairs, transposed.
__attribute__((target("avx512bw,avx512vl"), always_inline)) inline void transpose(__m512i* rows) {
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

/// Rows of the transpose are contiguous, `inner_stride` apart.
__attribute__((target("avx512bw,avx512vl"))) void split_columns(BFloat16* to, const float* from,
                                                                std::int64_t inner_stride,
                                                                std::int64_t rows, std::int64_t k) {
    for (std::int64_t i = 0; i < k; i += tile_step, to += tile_step_size) {
        for (std::int64_t first = 0; first < rows; first += tile_rows) {
            const __mmask16 lanes = first_lanes(rows - first);
            const float* const source = from + i * inner_stride + first;
            __m512i upper[16], lower[16];
            for (int pair = 0; pair < 16; ++pair) {
                const auto load = [&](std::int64_t row)
                    __attribute__((target("avx512bw,avx512vl"))) {
                    return i + row < k
                               ? split(_mm512_maskz_loadu_ps(lanes, source + row * inner_stride))
                               : Split{_mm512_setzero_si512(), _mm512_setzero_si512()};
                };
                const Split a = load(2 * pair), b = load(2 * pair + 1);
                upper[pair] = pairs_of(a.upper, b.upper);
                lower[pair] = pairs_of(a.lower, b.lower);
            }
            transpose(upper);
            transpose(lower);
            BFloat16* const target = to + first / tile_rows * tile_size;
            for (int row = 0; row < 16; ++row) {
                _mm512_storeu_si512(target + row * tile_step, upper[row]);
                _mm512_storeu_si512(target + 2 * tile_size + row * tile_step, lower[row]);
            }
        }
    }
}

/// The right operand, whose columns lie side by side.
__attribute__((target("avx512bw,avx512vl"))) void split_pairs_of_rows(BFloat16* to,
                                                                      const float* from,
                                                                      std::int64_t inner_stride,
                                                                      std::int64_t k,
                                                                      std::int64_t columns) {
    const __mmask16 left = first_lanes(columns), right = first_lanes(columns - 16);
    for (std::int64_t row = 0; row < chunk_count(k, tile_step) * tile_step; row += 2) {
        BFloat16* const target =
            to + row / tile_step * tile_step_size + row % tile_step / 2 * tile_step;
        const __mmask16 first = row < k ? 0xFFFF : 0, second = row + 1 < k ? 0xFFFF : 0;
        const float* const source = from + row * inner_stride;
        store_pairs(target, _mm512_maskz_loadu_ps(first & left, source),
                    _mm512_maskz_loadu_ps(second & left, source + inner_stride));
        store_pairs(target + tile_size, _mm512_maskz_loadu_ps(first & right, source + 16),
                    _mm512_maskz_loadu_ps(second & right, source + inner_stride + 16));
    }
}

/// The right operand, each of whose columns is contiguous.
__attribute__((target("avx512bw,avx512vl"))) void split_pairs_of_columns(BFloat16* to,
                                                                         const float* from,
                                                                         std::int64_t column_stride,
                                                                         std::int64_t k,
                                                                         std::int64_t columns) {
    const __m512i order = _mm512_load_si512(upper_halves.data());
    for (std::int64_t i = 0; i < k; i += tile_step, to += tile_step_size) {
        const __mmask16 first = first_lanes(k - i), second = first_lanes(k - i - 16);
        for (std::int64_t tile = 0; tile < 2; ++tile) {
            __m512i upper[16], lower[16];
            for (int j = 0; j < 16; ++j) {
                const std::int64_t column = tile * 16 + j;
                const bool exists = column < columns;
                const float* const source = from + column * column_stride + i;
                const Split a = split(_mm512_maskz_loadu_ps(exists ? first : 0, source)),
                            b = split(_mm512_maskz_loadu_ps(exists ? second : 0, source + 16));
                upper[j] = _mm512_permutex2var_epi16(a.upper, order, b.upper);
                lower[j] = _mm512_permutex2var_epi16(a.lower, order, b.lower);
            }
            transpose(upper);
            transpose(lower);
            BFloat16* const target = to + tile * tile_size;
            for (int row = 0; row < 16; ++row) {
                _mm512_store_si512(target + row * tile_step, upper[row]);
                _mm512_store_si512(target + 2 * tile_size + row * tile_step, lower[row]);
            }
        }
    }
}

/// The compiler does not know what tiles read and write in memory.
__attribute__((always_inline)) inline void finish_memory_accesses() {
    __asm__ volatile("" ::: "memory");
}

constexpr std::int64_t row_bytes = 64;

template <int row_tiles, int column_tiles>
__attribute__((target("amx-tile,amx-bf16"), noinline)) void multiply_block(const TileBlock& block) {
    constexpr std::int64_t columns = 16;
    finish_memory_accesses();
    const std::int64_t start_bytes = block.start_stride * 4, sums_bytes = block.sums_stride * 4;
    if (const float* const start = block.start; start == nullptr) {
        _tile_zero(0);
        _tile_zero(1);
        _tile_zero(2);
        _tile_zero(3);
    } else {
        _tile_loadd(0, start, start_bytes);
        if constexpr (column_tiles == 2) _tile_loadd(1, start + columns, start_bytes);
        if constexpr (row_tiles == 2) {
            const float* const below = start + tile_rows * block.start_stride;
            _tile_loadd(2, below, start_bytes);
            if constexpr (column_tiles == 2) _tile_loadd(3, below + columns, start_bytes);
        }
    }
    // Every load stands two products before the first one that needs it.
    const BFloat16 *left = block.left, *right = block.right;
    constexpr std::int64_t lower = 2 * tile_size;
    _tile_loadd(4, left, row_bytes);
    if constexpr (row_tiles == 2) _tile_loadd(5, left + tile_size, row_bytes);
    _tile_loadd(6, right + lower, row_bytes);
    if constexpr (column_tiles == 2) _tile_loadd(7, right + lower + tile_size, row_bytes);
    for (std::int64_t step = 0; step < block.steps; ++step) {
        _tile_dpbf16ps(0, 4, 6);
        if constexpr (row_tiles == 2) _tile_dpbf16ps(2, 5, 6);
        _tile_loadd(6, right, row_bytes);
        if constexpr (column_tiles == 2) {
            _tile_dpbf16ps(1, 4, 7);
            if constexpr (row_tiles == 2) _tile_dpbf16ps(3, 5, 7);
            _tile_loadd(7, right + tile_size, row_bytes);
        }
        _tile_dpbf16ps(0, 4, 6);
        if constexpr (column_tiles == 2) _tile_dpbf16ps(1, 4, 7);
        _tile_loadd(4, left + lower, row_bytes);
        if constexpr (row_tiles == 2) {
            _tile_dpbf16ps(2, 5, 6);
            if constexpr (column_tiles == 2) _tile_dpbf16ps(3, 5, 7);
            _tile_loadd(5, left + lower + tile_size, row_bytes);
        }
        // The last step's own operands once more instead of what lies behind them.
        const bool last = step + 1 == block.steps;
        left += last ? 0 : tile_step_size;
        right += last ? 0 : tile_step_size;
        _tile_dpbf16ps(0, 4, 6);
        if constexpr (row_tiles == 2) _tile_dpbf16ps(2, 5, 6);
        _tile_loadd(6, right + lower, row_bytes);
        if constexpr (column_tiles == 2) _tile_dpbf16ps(1, 4, 7);
        _tile_loadd(4, left, row_bytes);
        if constexpr (column_tiles == 2 && row_tiles == 2) _tile_dpbf16ps(3, 5, 7);
        if constexpr (row_tiles == 2) _tile_loadd(5, left + tile_size, row_bytes);
        if constexpr (column_tiles == 2) _tile_loadd(7, right + lower + tile_size, row_bytes);
    }
    float* const sums = block.sums;
    _tile_stored(0, sums, sums_bytes);
    if constexpr (column_tiles == 2) _tile_stored(1, sums + columns, sums_bytes);
    if constexpr (row_tiles == 2) {
        float* const below = sums + tile_rows * block.sums_stride;
        _tile_stored(2, below, sums_bytes);
        if constexpr (column_tiles == 2) _tile_stored(3, below + columns, sums_bytes);
    }
    finish_memory_accesses();
}

/// What LDTILECFG reads.
struct alignas(64) TileConfiguration {
    std::uint8_t palette = 1;
    std::uint8_t start_row = 0;
    std::array<std::uint8_t, 14> reserved{};
    std::array<std::uint16_t, 16> row_bytes{};
    std::array<std::uint8_t, 16> rows{};
};

constexpr TileConfiguration whole_tiles = [] {
    TileConfiguration configuration;
    for (std::size_t tile = 0; tile < 8; ++tile) {
        configuration.row_bytes[tile] = row_bytes;
        configuration.rows[tile] = tile_rows;
    }
    return configuration;
}();

}  // namespace

bool multiplies_tiles() {
    static const bool supported = processor_has_tiles() && system_grants_tiles();
    return supported;
}

__attribute__((target("amx-tile"))) TileLoan::TileLoan() {
    _tile_loadconfig(&whole_tiles);
}

__attribute__((target("amx-tile"))) TileLoan::~TileLoan() {
    _tile_release();
}

void split_left(BFloat16* to, const LeftMatrix<float>& left, std::int64_t rows, std::int64_t k) {
    if (left.inner_stride == 1) {
        split_rows(to, left.data, left.row_stride, rows, k);
    } else {
        split_columns(to, left.data, left.inner_stride, rows, k);
    }
}

void split_right(BFloat16* to, const float* from, std::int64_t k, std::int64_t columns,
                 std::int64_t inner_stride, std::int64_t column_stride) {
    if (column_stride == 1) {
        split_pairs_of_rows(to, from, inner_stride, k, columns);
    } else {
        split_pairs_of_columns(to, from, column_stride, k, columns);
    }
}

void multiply_tiles(int row_tiles, int column_tiles, const TileBlock& block) {
    if (row_tiles == 2) {
        column_tiles == 2 ? multiply_block<2, 2>(block) : multiply_block<2, 1>(block);
    } else {
        column_tiles == 2 ? multiply_block<1, 2>(block) : multiply_block<1, 1>(block);
    }
}

#else

bool multiplies_tiles() {
    return false;
}

TileLoan::TileLoan() = default;
TileLoan::~TileLoan() = default;

void split_left(BFloat16*, const LeftMatrix<float>&, std::int64_t, std::int64_t) {}
void split_right(BFloat16*, const float*, std::int64_t, std::int64_t, std::int64_t, std::int64_t) {}
void multiply_tiles(int, int, const TileBlock&) {}

#endif

bool takes_tiles(std::int64_t inner_length, std::int64_t panel_width) {
    constexpr std::int64_t least_inner_length = 16;  // less leaves most of a step empty
    return inner_length >= least_inner_length && panel_width == tile_block &&
           matmul_precision() == MatmulPrecision::high && multiplies_tiles();
}

}  // namespace stymo::kernels

namespace stymo {

bool has_matrix_tiles() {
    return kernels::multiplies_tiles();
}

}  // namespace stymo
