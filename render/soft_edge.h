#pragma once

#include "core/tensor.h"

namespace stymo {

/// The opacity (S, S, 1) of a head with a soft edge: the mask (S, S, 1), smoothed by the width of a
/// pixel of 256, on a ramp from 0 at 0.5 to 1. The model's own edge is as hard as the masks of its
/// training photos and shows as a staircase; farther out are colours that no training photo had. 1
/// everywhere if the mask is nowhere above 0.9: then the model was not trained with masks.
[[nodiscard]] Tensor soft_opacity(const Tensor& mask);

/// The image (S, S, 3) fading to black with `soft_opacity`.
[[nodiscard]] Tensor with_soft_edge(const Tensor& image, const Tensor& mask);

}  // namespace stymo
