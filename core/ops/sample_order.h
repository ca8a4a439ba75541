#pragma once

#include "core/tensor.h"

namespace stymo {

/// Throws ValueError naming `function` and the first interval that is negative (samples in reverse order) or not a number;
/// deltas (B, R, N).
void require_ordered_samples(const char* function, const Tensor& deltas);

}  // namespace stymo
