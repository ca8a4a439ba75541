#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// Images (B, H, W, C) with zero mean and almost unit deviation over each image, so that a network
/// does not depend on brightness and contrast.
[[nodiscard]] Variable unit_contrast(const Variable& images);

}  // namespace stymo
