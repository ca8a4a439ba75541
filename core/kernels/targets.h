#pragma once

/// The instruction sets for which Highway compiles kernels. Must be included before Highway's
/// other headers.
#ifdef __aarch64__
// The kernels use arrays of vectors, which need vectors of fixed length.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#else
// No kernel uses the instructions that this set adds to AVX3.
#define HWY_DISABLED_TARGETS HWY_AVX3_DL
#endif

#include <hwy/targets.h>

#include <cstdint>

namespace stymo::kernels {

/// The instruction sets that this processor has and `hwy::DisableTargets` allows, in Highway's
/// bits.
[[nodiscard]] inline std::int64_t allowed_targets() {
    const std::int64_t targets = hwy::SupportedTargets();
    // That call chose the best target of the processor, even if it is disabled.
    hwy::GetChosenTarget().Update(targets);
    return targets;
}

/// For kernels whose instructions Highway 1.0 does not support. False if `hwy::DisableTargets`
/// excludes its newest target, so that tests can run as on an older processor. All processors with
/// AMX or AVX-512-FP16 support that target.
[[nodiscard]] inline bool allows_newest_instructions() {
    return (allowed_targets() & HWY_AVX3_DL) != 0;
}

/// Highway's name of the instruction set for which it chooses kernels on this processor.
[[nodiscard]] const char* chosen_target();

}  // namespace stymo::kernels
