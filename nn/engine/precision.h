#pragma once

#include <span>

#include "nn/layers/linear.h"

namespace stymo {

/// Type of weights and activations of a real-time renderer. Sums are float32 in all of them, up to
/// what kernels::multiply_packed says of Float16.
enum class Precision { float32, bfloat16, float16 };

/// The type of 16 bits that this processor computes fastest: float16 with AVX-512-FP16, else
/// bfloat16; also bfloat16 if some layer's weights are too large for sums of float16, which are
/// finite while no input exceeds 16 (sines do not; the features of render blocks, whose weights
/// have rows of norm one, stay far below).
[[nodiscard]] Precision sixteen_bits_for(std::span<const FoldedLayer> layers);

}  // namespace stymo
