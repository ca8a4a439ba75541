#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// The learnt upsampling of an image: nearest neighbour plus detail, blurred by [1, 2, 1] with
/// mirrored border. x (B, h, w, C) and detail (B, h, w, 4 C), whose channel (2 i + j) C + c belongs
/// to channel c at row i, column j of the upsampled pixel -> (B, 2h, 2w, C). Keeps nothing for the
/// backward pass. Throws ShapeError for other extents.
[[nodiscard]] Variable blur_upsampled(const Variable& x, const Variable& detail);
/// The same composed of ops: its oracle, which float64 takes.
[[nodiscard]] Variable blur_upsampled_reference(const Variable& x, const Variable& detail);

}  // namespace stymo
