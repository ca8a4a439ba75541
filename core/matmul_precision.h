#pragma once

#include <string_view>

/// How accurate products of float32 are, as `torch.set_float32_matmul_precision` has it.
namespace stymo {

enum class MatmulPrecision {
    highest,  ///< fused multiply-adds of float32
    high,    ///< where the processor has matrix tiles (AMX), each operand is the sum of two numbers
             ///< of BFloat16, so that a product's relative error is at most
             ///< 2^-15; else as `highest`
    medium,  ///< there, each operand is rounded to BFloat16, so that a product's relative error is
             ///< at most 2^-7; else as `highest`
};

/// For all products of this process from now on; at first `highest`. Not while one is computed.
void set_matmul_precision(MatmulPrecision precision);
[[nodiscard]] MatmulPrecision matmul_precision();
/// "highest", "high" or "medium".
[[nodiscard]] const char* name_of(MatmulPrecision precision);
/// The precision of that name. Throws ValueError for another name.
[[nodiscard]] MatmulPrecision matmul_precision_of(std::string_view name);
/// Whether `high` and `medium` differ from `highest` on this processor.
[[nodiscard]] bool has_matrix_tiles();

}  // namespace stymo
