#pragma once

namespace stymo {

/// Type of weights and activations of a real-time renderer; sums are float32 in both.
enum class Precision { float32, bfloat16 };

}  // namespace stymo
