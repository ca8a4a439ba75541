#include "core/kernels/targets.h"

#include <hwy/detect_targets.h>

namespace stymo::kernels {

const char* chosen_target() {
    const std::int64_t targets = allowed_targets() & HWY_TARGETS;
    // Better targets have smaller numbers.
    return hwy::TargetName(targets & -targets);
}

}  // namespace stymo::kernels
