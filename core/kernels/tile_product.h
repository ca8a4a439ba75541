#pragma once

#include <cstdint>

#include "core/kernels/tile_split.h"

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

}  // namespace stymo::kernels
