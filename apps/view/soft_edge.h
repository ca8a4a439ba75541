#pragma once

#include "core/tensor.h"

namespace stymo::view {

/// The image (S, S, 3) of a head with a soft edge, for a screen that shows it enlarged: the model's
/// own edge is as hard as the masks of its training photos and shows as a staircase. It fades to
/// black where the mask (S, S, 1), smoothed by the width of a pixel of 256, falls from 1 to 0.5.
/// Unchanged if the mask is nowhere above 0.9: then the model was not trained with masks.
[[nodiscard]] Tensor with_soft_edge(const Tensor& image, const Tensor& mask);

}  // namespace stymo::view
