#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Blocks of Float16 products in half precision with AVX-512-FP16, whose instructions do twice as
/// many products as those of float32. Highway 1.0 does not support them.
namespace stymo::kernels {

/// Columns of a block, and of a panel of the right operand.
inline constexpr std::int64_t float16_columns = 32;

/// Whether the processor has AVX-512-FP16. If not, Float16 operands must be widened to float.
[[nodiscard]] bool multiplies_float16();

/// Index of element (i, j) in a panel. Two consecutive rows are interleaved; their even columns
/// come before their odd columns. With this layout, adding the sums of the two rows and merging
/// even and odd columns gives the columns in their order.
[[nodiscard]] constexpr std::int64_t float16_panel_index(std::int64_t i, std::int64_t j) {
    return i / 2 * 2 * float16_columns + j % 2 * float16_columns + j / 2 * 2 + i % 2;
}

/// Pairs of products that a lane sums in half precision. More pairs save conversions, but the error
/// grows with the square root of their number.
inline constexpr std::int64_t float16_pairs_at_once = 64;

/// Several rows of the left operand and a panel of the right one.
struct Float16Operands {
    const Float16* left;
    std::int64_t row_stride;
    const Float16* panel;
    std::int64_t panel_stride;  ///< between pairs of rows
    std::int64_t pairs;         ///< pairs of inner elements
};

/// A block of sums of products. The sums begin with the values in `start` and are written to
/// `sums`.
struct Float16Block {
    Float16Operands operands;
    const float* start;
    std::int64_t start_stride;  ///< 0: the same for each row
    float* sums;
    std::int64_t sums_stride;
};

/// A product with bias and activation, entirely in half precision, for at most
/// `float16_pairs_at_once` pairs.
struct Float16Layer {
    Float16Operands operands;
    const float* bias;
    bool leaky_relu;  ///< else no activation
    Float16* out;
    std::int64_t out_stride;
};

/// `rows` is 1, 2, 4, 8 or 12. May only be called if `multiplies_float16()`.
void multiply_float16_block(int rows, const Float16Block& block);
void multiply_float16_layer(int rows, const Float16Layer& layer);

}  // namespace stymo::kernels
