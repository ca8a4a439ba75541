#pragma once

#include "core/tensor.h"
#include "fit/morphable/morphable_fit.h"

namespace stymo {

/// The photo (S, S, 3) in [0, 1] with the fitted head drawn over it, half transparent, in its
/// fitted colours and light.
[[nodiscard]] Tensor with_fitted_head(const Tensor& photo, const MorphableHead& head,
                                      const MorphableFit& fit, const Intrinsics& intrinsics);

}  // namespace stymo
