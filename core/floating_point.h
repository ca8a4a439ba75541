#pragma once

namespace stymo {

/// From now on results below 2^-126 of float32, and 2^-1022 of float64, are zero on the calling
/// thread and on those that it starts. Processors compute with such subnormal numbers up to a
/// hundred times more slowly, and the gradients of samples behind a surface are full of them. Does
/// nothing on processors that are neither x86 nor ARM.
void flush_subnormals();

}  // namespace stymo
