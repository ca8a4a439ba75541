#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Blocks of products of Float16 in half precision, by the instructions of AVX-512-FP16: twice as
/// many products each as those of float32. Highway 1.0 does not know them.
namespace stymo::kernels {

/// Columns of a block, and of a panel of the right operand.
inline constexpr std::int64_t float16_columns = 32;

/// Whether the processor multiplies in half precision. If not, Float16 operands are to be widened.
[[nodiscard]] bool multiplies_float16();

/// Element (i, j) of a panel: pairs of consecutive rows lie side by side, those of the even columns
/// before those of the odd ones. The sums of both rows of a pair and of both kinds of columns then
/// meet in the order of the columns.
[[nodiscard]] constexpr std::int64_t float16_panel_index(std::int64_t i, std::int64_t j) {
    return i / 2 * 2 * float16_columns + j % 2 * float16_columns + j / 2 * 2 + i % 2;
}

/// Pairs of products that a lane adds up in half precision. The error grows with their root, and so
/// does the share of time that is not spent on conversions.
inline constexpr std::int64_t float16_pairs_at_once = 64;

/// Some rows of the left operand, and a panel of the right one.
struct Float16Operands {
    const Float16* left;
    std::int64_t row_stride;
    const Float16* panel;
    std::int64_t panel_stride;  ///< between pairs
    std::int64_t pairs;         ///< of inner elements
};

/// Sums of products, added to what stands in `start` and written to `sums`.
struct Float16Block {
    Float16Operands operands;
    const float* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    float* sums;
    std::int64_t sums_stride;
};

/// The same for at most `float16_pairs_at_once` pairs, in half precision to the end: a product, its
/// bias and its activation.
struct Float16Layer {
    Float16Operands operands;
    const float* bias;
    bool leaky_relu;  ///< else no activation
    Float16* out;
    std::int64_t out_stride;
};

/// rows: 1, 2, 4, 8 or 12. Only if `multiplies_float16()`.
void multiply_float16_block(int rows, const Float16Block& block);
void multiply_float16_layer(int rows, const Float16Layer& layer);

}  // namespace stymo::kernels
