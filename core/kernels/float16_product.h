#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Blocks of products of Float16 in half precision, by the instructions of AVX-512-FP16: twice as many products each as those of
/// float32. Highway 1.0 does not know them.
namespace stymo::kernels {

/// Columns of a block, and of a panel of the right operand.
inline constexpr std::int64_t float16_columns = 32;

/// Whether the processor multiplies in half precision. If not, Float16 operands are to be widened.
[[nodiscard]] bool multiplies_float16();

/// Element (i, j) of a panel: pairs of consecutive rows lie side by side, those of the even columns before those of the odd ones.
/// The sums of both rows of a pair and of both kinds of columns then meet in the order of the columns.
[[nodiscard]] constexpr std::int64_t float16_panel_index(std::int64_t i, std::int64_t j) {
    return i / 2 * 2 * float16_columns + j % 2 * float16_columns + j / 2 * 2 + i % 2;
}

/// Sums of products of `pairs` pairs of inner elements, added to what stands in `start` and written to `sums`.
struct Float16Block {
    const float* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    float* sums;
    std::int64_t sums_stride;
    const Float16* left;
    std::int64_t row_stride;
    const Float16* panel;
    std::int64_t panel_stride;  ///< between pairs
    std::int64_t pairs;
};

/// rows: 1, 2, 4, 8 or 12. Only if `multiplies_float16()`.
void multiply_float16_block(int rows, const Float16Block& block);

}  // namespace stymo::kernels
