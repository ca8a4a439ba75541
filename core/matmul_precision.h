#pragma once

#include <string_view>

/// Accuracy of float32 matrix products, like `torch.set_float32_matmul_precision`.
namespace stymo {

enum class MatmulPrecision {
    highest,  ///< fused multiply-adds of float32
    high,     ///< if the processor has matrix tiles (AMX), each operand is the sum of two BFloat16
              ///< numbers, and a product's relative error is at most 2^-15; else like `highest`
    medium,   ///< if the processor has matrix tiles or dot products of BFloat16 (AVX512-BF16), each
              ///< operand is rounded to BFloat16, and a product's relative error is at most 2^-7;
              ///< else like `highest`
};

/// Sets the precision of all later products in this process; the default is `highest`. Must not be
/// called while a product is computed.
void set_matmul_precision(MatmulPrecision precision);
[[nodiscard]] MatmulPrecision matmul_precision();
/// "highest", "high" or "medium".
[[nodiscard]] const char* name_of(MatmulPrecision precision);
/// The precision of that name. Throws ValueError for another name.
[[nodiscard]] MatmulPrecision matmul_precision_of(std::string_view name);
/// What this processor computes if that precision is set.
[[nodiscard]] MatmulPrecision computed_precision(MatmulPrecision precision);
/// The instructions of this processor for products of BFloat16: "AMX", "AVX512-BF16" or "none".
[[nodiscard]] const char* bfloat16_instructions();

/// Sets the precision while it lives.
class PrecisionScope {
public:
    /// With `emulates`, for tests, `medium` rounds operands on every processor, by code that is
    /// slow and needs no instructions for BFloat16. Matrices are then packed and multiplied in the
    /// same scope.
    explicit PrecisionScope(MatmulPrecision precision, bool emulates = false);
    ~PrecisionScope();
    PrecisionScope(const PrecisionScope&) = delete;
    PrecisionScope& operator=(const PrecisionScope&) = delete;

private:
    MatmulPrecision before_;
    bool emulated_before_;
};
[[nodiscard]] bool emulates_medium();

}  // namespace stymo
