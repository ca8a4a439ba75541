#pragma once

#include <cstdint>

#include "core/kernels/tile_split.h"

/// Products of float32 on the matrix tiles of AMX, added up in float32. Each number becomes one of
/// BFloat16, with an error of a product of at most 2^-7 |a| |b|, or the sum of two of them, of
/// which three products are added up:
///   a b = upper(a) upper(b) + upper(a) lower(b) + lower(a) upper(b)
/// Their error is at most 2^-15 |a| |b| (Henry, Tang and Heinecke 2019, "Leveraging the bfloat16
/// artificial intelligence datatype for higher-precision computations"). In two parts, an infinite
/// operand may give NaN, and a NaN whose bits are all ones is lost; products below 2^-126 may
/// become zero.
namespace stymo::kernels {

/// Whether processor and system have tiles. If not, nothing below may be called.
[[nodiscard]] bool multiplies_tiles();

/// Numbers of BFloat16 that stand for each number of a product of that inner length, with panels so
/// wide; 0: it does not use tiles. Depends on nothing that differs between blocks of a product, so
/// that its bits depend neither on the block nor on the number of threads.
[[nodiscard]] int tile_parts(std::int64_t inner_length, std::int64_t panel_width);

/// Lends the tiles to the calling thread. Without one alive, `multiply_tiles` may not be called.
class TileLoan {
public:
    TileLoan();
    ~TileLoan();
    TileLoan(const TileLoan&) = delete;
    TileLoan& operator=(const TileLoan&) = delete;
};

/// Sums of `steps` steps, added to what stands in `start` (null: zeros) and written to `sums`.
struct TileBlock {
    int parts;  ///< of each number
    const BFloat16* left;
    const BFloat16* right;
    std::int64_t steps;
    const float* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    float* sums;
    std::int64_t sums_stride;
};

/// One or two tiles of 16 rows, and of 16 columns.
void multiply_tiles(int row_tiles, int column_tiles, const TileBlock& block);

}  // namespace stymo::kernels
