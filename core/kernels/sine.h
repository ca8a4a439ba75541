#pragma once

#include <cstdint>

/// The sine and cosine of the library. Linear layers with a sine (core/kernels/gemm.h) give the
/// same bits.
namespace stymo::kernels {

/// sines[i] = sin x[i] and cosines[i] = cos x[i]; either result may be null. float32 uses vector
/// code with an absolute error below 3e-7, and the standard library for |x| > 8192, infinity and
/// NaN. float64 uses the standard library. Each result depends only on its own element. The arrays
/// must not overlap.
void sine_cosine(const float* x, float* sines, float* cosines, std::int64_t count);
void sine_cosine(const double* x, double* sines, double* cosines, std::int64_t count);

}  // namespace stymo::kernels
