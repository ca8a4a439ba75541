#pragma once

#include <hwy/targets.h>

/// For kernels whose instructions Highway 1.0 does not support.
namespace stymo::kernels {

/// False if `hwy::DisableTargets` excludes Highway's newest target, so that tests can run as on an
/// older processor. All processors with AMX or AVX-512-FP16 support that target.
[[nodiscard]] inline bool allows_newest_instructions() {
    return (hwy::SupportedTargets() & HWY_AVX3_DL) != 0;
}

}  // namespace stymo::kernels
