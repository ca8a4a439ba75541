#pragma once

/// Which instruction sets Highway compiles kernels for; to be included before Highway.
#ifdef __aarch64__
// Arrays of vectors need vectors of a fixed length.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#else
// Nothing here needs what this set adds to AVX3.
#define HWY_DISABLED_TARGETS HWY_AVX3_DL
#endif
