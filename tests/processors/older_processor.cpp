// Makes a program run as on an older x86-64 processor, for LD_PRELOAD. STYMO_PROCESSOR is the best
// target that Highway may choose: SSE2, SSSE3, SSE4, AVX2, AVX3 (AVX-512 without AMX and FP16).
#include <hwy/targets.h>

#include <cstdlib>
#include <cstring>
#include <iostream>

namespace {

constexpr struct {
    const char* name;
    std::int64_t target;
} targets[]{{"SSE2", HWY_EMU128},
            {"SSSE3", HWY_SSSE3},
            {"SSE4", HWY_SSE4},
            {"AVX2", HWY_AVX2},
            {"AVX3", HWY_AVX3}};

/// Better targets have smaller numbers.
__attribute__((constructor)) void disable_better_targets() {
    const char* const wanted = std::getenv("STYMO_PROCESSOR");
    for (const auto& [name, target] : targets) {
        if (wanted == nullptr || std::strcmp(name, wanted) != 0) continue;
        const bool early = !hwy::GetChosenTarget().IsInitialized();
        const bool exists = target == HWY_EMU128 || (hwy::SupportedTargets() & target) != 0;
        hwy::DisableTargets(target - 1);
        // The next kernel chooses its target; SupportedTargets() would choose a disabled one.
        if (early && exists) return;
    }
    std::cerr << "older_processor: this processor does not have STYMO_PROCESSOR\n";
    std::_Exit(1);
}

}  // namespace
