#include "nn/pretrained/unit_contrast.h"

#include <vector>

#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"

namespace stymo {

Variable unit_contrast(const Variable& images) {
    const std::vector<int> axes{1, 2, 3};
    const Variable centered = images - mean(images, axes);
    return centered / sqrt(mean(square(centered), axes) + 1e-3);
}

}  // namespace stymo
