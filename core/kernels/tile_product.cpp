// Products on matrix tiles (AMX), or on blocks of the same shape without them (tile_dots.cpp).
//
// TDPBF16PS multiplies a tile of 16 rows by 32 inner elements of bfloat16 with one of 32 inner
// elements by 16 columns, and adds the product to a tile of 16 x 16 float32 sums: 8,192
// multiply-adds in one instruction, many times the rate of float32 vectors. Two things stand
// between this and a product of float32.
//
// Precision. A bfloat16 number has 8 significant bits. Rounding both factors gives a product with a
// relative error of up to 2^-7. With each number as a sum of two, a = a1 + a2 + r, the rounding of
// the first leaves |a2| <= 2^-8 |a|, and that of the remainder |r| <= 2^-17 |a|. Of the product
//
//     a b = a1 b1 + a1 b2 + a2 b1 + (a2 b2 + terms with r)
//
// three terms are computed, in float32. What is left out is at most 2^-16 + 2 * 2^-17 = 2^-15 of
// |a b| (Henry, Tang and Heinecke 2019). Three instructions for one are still faster than float32
// vectors; the fourth term would gain one bit for a third more work. matmul_precision.h selects one
// part (`medium`), two (`high`) or float32 (`highest`). tile_split.cpp makes the parts.
//
// Loads. There are eight tile registers. A block of 2 x 2 tiles of sums takes four of them and two
// tiles of each operand the rest, so that every operand is used twice for one load. With two parts
// the three terms are taken in the order
//
//     left upper * right lower,   left upper * right upper,   left lower * right upper.
//
// From one term to the next only one operand changes, so each of the eight operand tiles of a step
// is loaded once for its twelve products.
//
// Sums begin with the bias or with the values that are present, and stay in the tiles for up to
// 1,024 inner elements (gemm_tiles-inl.h). On one processor and at one precision, whether a product
// uses tiles depends on its inner length and panel width, never on the block or the thread, so
// results are the same on any number of threads. `stymo-bench kernels` compares the speed with that
// of vectors.

#include "core/kernels/tile_product.h"

#include "core/kernels/targets.h"
#include "core/matmul_precision.h"

#if defined(__x86_64__) && defined(__linux__)
#include <cpuid.h>
#include <immintrin.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>

#define STYMO_TILES __attribute__((target("amx-tile,amx-bf16"), always_inline)) inline
#endif

namespace stymo::kernels {

#if defined(__x86_64__) && defined(__linux__)

namespace {

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
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bf16") &&
           allows_newest_instructions();
}

/// The compiler does not know what tiles read and write in memory.
__attribute__((always_inline)) inline void finish_memory_accesses() {
    __asm__ volatile("" ::: "memory");
}

constexpr std::int64_t row_bytes = 64;

constexpr std::int64_t tile_columns = 16;  ///< of sums

/// Tiles 0 to 3 hold sums, 4 and 5 the left operand, 6 and 7 the right one.
template <int row_tiles, int column_tiles>
STYMO_TILES void load_sums(const float* from, std::int64_t stride) {
    if (from == nullptr) {
        _tile_zero(0);
        _tile_zero(1);
        _tile_zero(2);
        _tile_zero(3);
        return;
    }
    const std::int64_t bytes = stride * 4;
    const float* const below = from + tile_height * stride;
    _tile_loadd(0, from, bytes);
    if constexpr (column_tiles == 2) _tile_loadd(1, from + tile_columns, bytes);
    if constexpr (row_tiles == 2) _tile_loadd(2, below, bytes);
    if constexpr (row_tiles == 2 && column_tiles == 2) _tile_loadd(3, below + tile_columns, bytes);
}

template <int row_tiles, int column_tiles>
STYMO_TILES void store_sums(float* to, std::int64_t stride) {
    const std::int64_t bytes = stride * 4;
    float* const below = to + tile_height * stride;
    _tile_stored(0, to, bytes);
    if constexpr (column_tiles == 2) _tile_stored(1, to + tile_columns, bytes);
    if constexpr (row_tiles == 2) _tile_stored(2, below, bytes);
    if constexpr (row_tiles == 2 && column_tiles == 2) _tile_stored(3, below + tile_columns, bytes);
}

template <int row_tiles, int column_tiles>
STYMO_TILES void sum_one_part(const TileBlock& block) {
    const BFloat16 *left = block.left, *right = block.right;
    _tile_loadd(4, left, row_bytes);
    if constexpr (row_tiles == 2) _tile_loadd(5, left + tile_size, row_bytes);
    _tile_loadd(6, right, row_bytes);
    if constexpr (column_tiles == 2) _tile_loadd(7, right + tile_size, row_bytes);
    for (std::int64_t step = 0; step < block.steps; ++step) {
        // The last step's own operands once more instead of what lies behind them.
        const std::int64_t next = step + 1 == block.steps ? 0 : tile_step_size;
        left += next;
        right += next;
        _tile_dpbf16ps(0, 4, 6);
        if constexpr (row_tiles == 2) _tile_dpbf16ps(2, 5, 6);
        _tile_loadd(6, right, row_bytes);
        if constexpr (column_tiles == 2) _tile_dpbf16ps(1, 4, 7);
        _tile_loadd(4, left, row_bytes);
        if constexpr (row_tiles == 2 && column_tiles == 2) _tile_dpbf16ps(3, 5, 7);
        if constexpr (row_tiles == 2) _tile_loadd(5, left + tile_size, row_bytes);
        if constexpr (column_tiles == 2) _tile_loadd(7, right + tile_size, row_bytes);
    }
}

template <int row_tiles, int column_tiles>
STYMO_TILES void sum_two_parts(const TileBlock& block) {
    // Every load is placed two products before its first use.
    const BFloat16 *left = block.left, *right = block.right;
    constexpr std::int64_t lower = tile_step_size;
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
        const std::int64_t next = step + 1 == block.steps ? 0 : 2 * tile_step_size;
        left += next;
        right += next;
        _tile_dpbf16ps(0, 4, 6);
        if constexpr (row_tiles == 2) _tile_dpbf16ps(2, 5, 6);
        _tile_loadd(6, right + lower, row_bytes);
        if constexpr (column_tiles == 2) _tile_dpbf16ps(1, 4, 7);
        _tile_loadd(4, left, row_bytes);
        if constexpr (column_tiles == 2 && row_tiles == 2) _tile_dpbf16ps(3, 5, 7);
        if constexpr (row_tiles == 2) _tile_loadd(5, left + tile_size, row_bytes);
        if constexpr (column_tiles == 2) _tile_loadd(7, right + lower + tile_size, row_bytes);
    }
}

template <int row_tiles, int column_tiles>
__attribute__((target("amx-tile,amx-bf16"), noinline)) void multiply_block(const TileBlock& block) {
    finish_memory_accesses();
    load_sums<row_tiles, column_tiles>(block.start, block.start_stride);
    if (block.parts == 1) {
        sum_one_part<row_tiles, column_tiles>(block);
    } else {
        sum_two_parts<row_tiles, column_tiles>(block);
    }
    store_sums<row_tiles, column_tiles>(block.sums, block.sums_stride);
    finish_memory_accesses();
}

/// The operand of LDTILECFG.
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
        configuration.rows[tile] = tile_height;
    }
    return configuration;
}();

// GCC 12 ignores the attribute of a constructor.
__attribute__((target("amx-tile"))) void configure_tiles() {
    _tile_loadconfig(&whole_tiles);
}

__attribute__((target("amx-tile"))) void release_tiles() {
    _tile_release();
}

}  // namespace

bool multiplies_tiles() {
    static const bool supported = processor_has_tiles() && system_grants_tiles();
    return supported;
}

TileLoan::TileLoan() {
    if (multiplies_tiles()) configure_tiles();
}

TileLoan::~TileLoan() {
    if (multiplies_tiles()) release_tiles();
}

void multiply_tiles(int row_tiles, int column_tiles, const TileBlock& block) {
    if (!multiplies_tiles()) return multiply_tile_dots(column_tiles, block);
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

void multiply_tiles(int, int, const TileBlock&) {}

#endif

int tile_parts(std::int64_t inner_length, std::int64_t panel_width, MatmulPrecision precision) {
    if (panel_width != tile_block || !lowers_precision(inner_length, precision) ||
        emulates_medium())
        return 0;
    return precision == MatmulPrecision::high ? 2 : 1;
}

bool lowers_precision(std::int64_t inner_length, MatmulPrecision precision) {
    // With a shorter inner length, most of a step is empty.
    constexpr std::int64_t least_inner_length = 16;
    return inner_length >= least_inner_length &&
           computed_precision(precision) != MatmulPrecision::highest;
}

}  // namespace stymo::kernels

namespace stymo {

MatmulPrecision computed_precision(MatmulPrecision precision) {
    const bool computes =
        precision == MatmulPrecision::medium
            ? emulates_medium() || kernels::multiplies_tiles() || kernels::multiplies_dots()
            // The three products of two parts would take dot products longer than
            // float32.
            : kernels::multiplies_tiles();
    return computes ? precision : MatmulPrecision::highest;
}

const char* bfloat16_instructions() {
    if (kernels::multiplies_tiles()) return "AMX";
    return kernels::multiplies_dots() ? "AVX512-BF16" : "none";
}

}  // namespace stymo
