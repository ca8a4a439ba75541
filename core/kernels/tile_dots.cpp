// Blocks of tiles without tile registers.
//
// VDPBF16PS multiplies 32 pairs of bfloat16 and adds each pair's sum to a float32: twice the work
// of a multiply-add of float32 in the same time (AMD Zen 4 and 5). On Intel's processors with tiles
// it takes four times as long as a multiply-add, so they never use it. The operands have the layout
// of the tiles, in which a row of the right one is a vector of 16 columns' pairs, and a pair of the
// left one is a 32-bit word that the processor broadcasts.

#include <algorithm>

#include "core/kernels/targets.h"
#include "core/kernels/tile_product.h"
#include "core/parallel.h"

#ifdef __x86_64__
#include <cpuid.h>
#include <immintrin.h>

#include <cstring>

#define STYMO_DOTS __attribute__((target("avx512bw,avx512vl,avx512bf16")))
#endif

namespace stymo::kernels {

#ifdef __x86_64__

namespace {

bool processor_has_tiles() {
    unsigned a = 0, b = 0, c = 0, d = 0;
    constexpr unsigned amx_bfloat16 = 1U << 22;
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) != 0 && (d & amx_bfloat16) != 0;
}

/// Pairs of the inner dimension that are multiplied without asking whether there are more.
constexpr std::int64_t pairs_at_once = 4;

/// The sums of `rows` rows from row `first` on. With two vectors, eleven rows leave registers for
/// both vectors of the right operand.
template <int rows, int vectors>
STYMO_DOTS void multiply_rows(const TileBlock& block, std::int64_t first) {
    __m512 sums[rows][vectors];
    const float* const start = block.start + first * block.start_stride;
#pragma GCC unroll 16
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v)
            sums[row][v] =
                block.start == nullptr
                    ? _mm512_setzero_ps()
                    : _mm512_loadu_ps(start + row * block.start_stride + v * tile_height);
    }
    const BFloat16* left = block.left + first * tile_step;
    const BFloat16* right = block.right;
    for (std::int64_t rest = block.inner; rest > 0; rest -= tile_step) {
        for (std::int64_t i = 0; i < std::min(rest, tile_step); i += 2 * pairs_at_once) {
#pragma GCC unroll 4
            for (std::int64_t pair = 0; pair < pairs_at_once; ++pair) {
                __m512i columns[vectors];
                for (int v = 0; v < vectors; ++v)
                    columns[v] = _mm512_load_si512(right + v * tile_size + pair * tile_step);
#pragma GCC unroll 16
                for (int row = 0; row < rows; ++row) {
                    std::int32_t word = 0;
                    std::memcpy(&word, left + row * tile_step + 2 * pair, sizeof(word));
                    const auto factor = reinterpret_cast<__m512bh>(_mm512_set1_epi32(word));
                    for (int v = 0; v < vectors; ++v)
                        sums[row][v] = _mm512_dpbf16_ps(sums[row][v], factor,
                                                        reinterpret_cast<__m512bh>(columns[v]));
                }
            }
            left += 2 * pairs_at_once;
            right += pairs_at_once * tile_step;
        }
        left += tile_step_size - tile_step;
        right += tile_step_size - tile_size;
    }
    float* const to = block.sums + first * block.sums_stride;
#pragma GCC unroll 16
    for (int row = 0; row < rows; ++row) {
        for (int v = 0; v < vectors; ++v)
            _mm512_storeu_ps(to + row * block.sums_stride + v * tile_height, sums[row][v]);
    }
}

}  // namespace

bool multiplies_dots() {
    static const bool supported = __builtin_cpu_supports("avx512bf16") != 0 &&
                                  !processor_has_tiles() && allows_newest_instructions();
    return supported;
}

void multiply_tile_dots(int column_tiles, const TileBlock& block) {
    if (column_tiles == 1) {
        for (std::int64_t row = 0; row < block.rows; row += tile_height)
            multiply_rows<16, 1>(block, row);
        return;
    }
    const std::int64_t passes = chunk_count(block.rows, 11),
                       height = chunk_count(block.rows, passes);
    for (std::int64_t row = 0; row < block.rows;) {
        if (height <= 8) {
            multiply_rows<8, 2>(block, row);
            row += 8;
        } else if (height <= 10 || row + 11 > tile_block) {
            multiply_rows<10, 2>(block, row);
            row += 10;
        } else {
            multiply_rows<11, 2>(block, row);
            row += 11;
        }
    }
}

#else

bool multiplies_dots() {
    return false;
}
void multiply_tile_dots(int, const TileBlock&) {}

#endif

}  // namespace stymo::kernels
