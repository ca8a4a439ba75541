#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Operands of products on matrix tiles (core/kernels/tile_product.h): float32 numbers as BFloat16
/// parts, in the memory layout of the tiles. With one part, each number is rounded to nearest even.
/// With two parts, the second is the rounded remainder of the first, and the number is about their
/// sum.
namespace stymo::kernels {

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
