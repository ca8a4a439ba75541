#pragma once

#include <string_view>

/// Accuracy of float32 matrix products, like `torch.set_float32_matmul_precision`.
namespace stymo {

enum class MatmulPrecision {
    highest,  ///< fused multiply-adds of float32
    high,     ///< if the processor has matrix tiles (AMX), each operand is the sum of two BFloat16
              ///< numbers, and a product's relative error is at most 2^-15; else like `highest`
    medium,   ///< with matrix tiles, each operand is rounded to BFloat16, and a product's relative
              ///< error is at most 2^-7; else like `highest`
};

/// Sets the precision of all later products in this process; the default is `highest`. Must not be
/// called while a product is computed.
void set_matmul_precision(MatmulPrecision precision);
[[nodiscard]] MatmulPrecision matmul_precision();
/// "highest", "high" or "medium".
[[nodiscard]] const char* name_of(MatmulPrecision precision);
/// The precision of that name. Throws ValueError for another name.
[[nodiscard]] MatmulPrecision matmul_precision_of(std::string_view name);
/// Whether `high` and `medium` differ from `highest` on this processor.
[[nodiscard]] bool has_matrix_tiles();

}  // namespace stymo
