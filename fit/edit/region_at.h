#pragma once

#include "core/tensor.h"

namespace stymo {

/// The part of a picture that a user points at, without a face parser: 1 on the connected pixels
/// whose colour is close to that around the point, else 0, as (S, S, 1). `image` is (S, S, 3) in
/// [0, 1]; x to the right and y down in [0, 1] of its side; `reach` scales the distance in CIELAB
/// up to which colours count as close. Throws ShapeError for another shape, ValueError for a point
/// outside the image or a reach that is not positive.
[[nodiscard]] Tensor region_at(const Tensor& image, double x, double y, double reach = 1.0);

}  // namespace stymo
