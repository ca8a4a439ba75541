#pragma once

#include "core/tensor.h"

namespace stymo {

/// The part of an image that a user points at, found without a face parser: a mask (S, S, 1), 1 on
/// the connected pixels whose colour is close to that around the point, else 0. `image` is (S, S,
/// 3) in [0, 1]; x (right) and y (down) are in [0, 1]; `reach` scales the largest distance in
/// CIELAB of close colours. Throws ShapeError for another shape, ValueError for a point outside the
/// image or a reach that is not positive.
[[nodiscard]] Tensor region_at(const Tensor& image, double x, double y, double reach = 1.0);

}  // namespace stymo
