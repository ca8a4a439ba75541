#pragma once

/// The instruction sets for which Highway compiles kernels. Must be included before Highway.
#ifdef __aarch64__
// The kernels use arrays of vectors, which need vectors of fixed length.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#else
// No kernel uses the instructions that this set adds to AVX3.
#define HWY_DISABLED_TARGETS HWY_AVX3_DL
#endif
