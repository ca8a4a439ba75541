#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// Learnt upsampling of an image: nearest-neighbour upsampling plus detail, blurred by [1, 2, 1] /
/// 4 along both axes with mirrored border. x (B, h, w, C) and detail (B, h, w, 4 C) -> (B, 2h, 2w,
/// C). Channel (2 i + j) C + c of the detail belongs to channel c at row i, column j of the
/// upsampled pixel. Saves nothing for the backward pass. Throws ShapeError for other extents.
[[nodiscard]] Variable blur_upsampled(const Variable& x, const Variable& detail);
/// The same as a composition of ops: the reference implementation, which is also used for float64.
[[nodiscard]] Variable blur_upsampled_reference(const Variable& x, const Variable& detail);

}  // namespace stymo
