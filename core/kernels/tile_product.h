#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Products of float32 on the matrix tiles of AMX, or by the dot products of AVX512-BF16, summed in
/// float32. Each number is rounded to BFloat16, with an error of at most 2^-7 |a| |b| for a
/// product, or is split into two BFloat16 parts, and three products are summed:
///
///     a b = upper(a) upper(b) + upper(a) lower(b) + lower(a) upper(b)
///
/// The error of this sum is at most 2^-15 |a| |b| (Henry, Tang and Heinecke 2019, "Leveraging the
/// bfloat16 artificial intelligence datatype for higher-precision computations"). With two parts,
/// an infinite operand may give NaN, and a NaN whose bits are all ones is lost. Products below
/// 2^-126 may become zero.
namespace stymo::kernels {

/// Whether the processor and the operating system support matrix tiles.
[[nodiscard]] bool multiplies_tiles();

/// Number of BFloat16 parts of each number in a product of this inner length, panel width and
/// precision; 0 if the product does not use tiles. It is the same for all blocks of a product, so
/// that results depend neither on the block nor on the number of threads. If it is 0 for every
/// product, the functions below may not be called.
[[nodiscard]] int tile_parts(std::int64_t inner_length, std::int64_t panel_width,
                             MatmulPrecision precision);
/// Whether products of this inner length and precision are less accurate than float32.
[[nodiscard]] bool lowers_precision(std::int64_t inner_length, MatmulPrecision precision);

/// Configures the tiles for the calling thread during its lifetime. `multiply_tiles` may only be
/// called while a TileLoan of the thread exists.
class TileLoan {
public:
    TileLoan();
    ~TileLoan();
    TileLoan(const TileLoan&) = delete;
    TileLoan& operator=(const TileLoan&) = delete;
};

/// A block of sums over `steps` steps. The sums begin with the values in `start` (null: zeros) and
/// are written to `sums`.
struct TileBlock {
    int parts;  ///< of each number
    const BFloat16* left;
    const BFloat16* right;
    std::int64_t steps;
    std::int64_t rows;   ///< that are wanted
    std::int64_t inner;  ///< elements that may differ from zero
    const float* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    float* sums;
    std::int64_t sums_stride;
};

/// Multiplies a block of one or two tiles of 16 rows, and one or two of 16 columns.
void multiply_tiles(int row_tiles, int column_tiles, const TileBlock& block);

/// Whether blocks of tiles are multiplied by the dot products of AVX512-BF16, which every processor
/// with AVX512-BF16 and without AMX does.
[[nodiscard]] bool multiplies_dots();

/// `multiply_tiles` by those instructions, for one part. Leaves the other rows of the block's
/// tiles undefined.
void multiply_tile_dots(int column_tiles, const TileBlock& block);

// Operands: float32 numbers as BFloat16 parts, in the memory layout of the tiles. With one part,
// each number is rounded to nearest even. With two parts, the second is the rounded remainder of
// the first, and the number is about their sum.

inline constexpr std::int64_t tile_height = 16;
/// Elements of a tile: 16 rows of 64 bytes.
inline constexpr std::int64_t tile_size = 512;
/// Rows and columns of a block of sums, which is two tiles high and two tiles wide.
inline constexpr std::int64_t tile_block = 32;
/// Inner elements of a step: those of one tile.
inline constexpr std::int64_t tile_step = 32;
/// Elements of one part of a step's operand.
inline constexpr std::int64_t tile_step_size = tile_block * tile_step;

/// Splits `rows` rows (at most `tile_block`) of k elements into chunk_count(k, tile_step) steps of
/// one or two parts.
void split_left(int parts, BFloat16* to, const LeftMatrix<float>& left, std::int64_t rows,
                std::int64_t k);
/// Splits k rows of `columns` columns (at most `tile_block`; the others become zeros). One of the
/// strides is 1.
void split_right(int parts, BFloat16* to, const float* from, std::int64_t k, std::int64_t columns,
                 std::int64_t inner_stride, std::int64_t column_stride);

}  // namespace stymo::kernels
