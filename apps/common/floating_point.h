#pragma once

namespace stymo {

/// Flushes subnormal results (magnitudes below 2^-126 in float32 and 2^-1022 in float64) to zero,
/// on the calling thread and on threads that it starts later. Processors compute far more slowly
/// with subnormal numbers, which are frequent in fits (docs/decisions.md). Does nothing on
/// processors that are neither x86 nor ARM.
void flush_subnormals();

}  // namespace stymo
