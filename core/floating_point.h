#pragma once

namespace stymo {

/// From now on results below 2^-126 of float32, and 2^-1022 of float64, are zero on the calling
/// thread and on those that it starts. Processors compute far more slowly with such
/// subnormal numbers, which fits meet often (docs/decisions.md). Does nothing on processors that
/// are neither x86 nor ARM.
void flush_subnormals();

}  // namespace stymo
