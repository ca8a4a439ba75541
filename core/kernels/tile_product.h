#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Products of float32 on the matrix tiles of AMX. Each number becomes the sum of two of BFloat16,
/// of which three products are added up in float32:
///   a b = upper(a) upper(b) + upper(a) lower(b) + lower(a) upper(b)
/// The error is at most 2^-15 |a| |b| (Henry, Tang and Heinecke 2019, "Leveraging the bfloat16
/// artificial intelligence datatype for higher-precision computations"). An infinite operand may
/// give NaN, and a NaN whose bits are all ones is lost; products below 2^-126 may become zero.
namespace stymo::kernels {

/// Rows and columns of a block of sums: two tiles each.
inline constexpr std::int64_t tile_block = 32;
/// Inner elements of a step: one tile's.
inline constexpr std::int64_t tile_step = 32;
/// Elements of a step's operand, upper and lower parts together.
inline constexpr std::int64_t tile_step_size = 2 * tile_block * tile_step;

/// Whether processor and system have tiles. If not, nothing below may be called.
[[nodiscard]] bool multiplies_tiles();

/// Whether a product of that inner length, with panels so wide, is to use tiles. Depends on nothing
/// that differs between parts of a product, so that its bits depend neither on the part nor on the
/// number of threads.
[[nodiscard]] bool takes_tiles(std::int64_t inner_length, std::int64_t panel_width);

/// Lends the tiles to the calling thread. Without one alive, `multiply_tiles` may not be called.
class TileLoan {
public:
    TileLoan();
    ~TileLoan();
    TileLoan(const TileLoan&) = delete;
    TileLoan& operator=(const TileLoan&) = delete;
};

/// Splits `rows` rows (at most `tile_block`) of k elements into chunk_count(k, tile_step) steps.
void split_left(BFloat16* to, const LeftMatrix<float>& left, std::int64_t rows, std::int64_t k);
/// Splits k rows of `columns` columns (at most `tile_block`; the others become zeros). One of the
/// strides is 1.
void split_right(BFloat16* to, const float* from, std::int64_t k, std::int64_t columns,
                 std::int64_t inner_stride, std::int64_t column_stride);

/// Sums of `steps` steps, added to what stands in `start` (null: zeros) and written to `sums`.
struct TileBlock {
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
