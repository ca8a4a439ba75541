#pragma once

#include <span>

#include "nn/layers/linear.h"

namespace stymo {

/// Type of weights and activations of a real-time renderer. Sums are float32;
/// kernels::multiply_packed states the exception for Float16.
enum class Precision { float32, bfloat16, float16 };

/// The 16-bit type that this processor computes fastest: float16 with AVX-512-FP16, else bfloat16.
/// Returns bfloat16 too if a layer's weights are so large that a sum in float16 could overflow for
/// inputs of magnitude 16. Inputs stay below that: sines are at most 1, and features of render
/// blocks, whose weights have rows of norm one, stay far below 16.
[[nodiscard]] Precision sixteen_bits_for(std::span<const FoldedLayer> layers);

}  // namespace stymo
