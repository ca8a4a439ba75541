#pragma once

#include <cstdint>

#include "core/kernels/gemm.h"

/// Colours of feature rows, and conversion from and to the type of activations (float, BFloat16 or
/// Float16). All functions run on the calling thread; the instruction set is chosen at run time.
namespace stymo::kernels {

/// to (pixels, 3) += x weight^T - background, with x (pixels, channels), weight (3, channels) and
/// background (3).
void add_colors(float* to, const float* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels);
void add_colors(float* to, const BFloat16* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels);
void add_colors(float* to, const Float16* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels);

/// Converts to the type of activations, rounded to nearest even.
void narrow(float* out, const float* x, std::int64_t count);
void narrow(BFloat16* out, const float* x, std::int64_t count);
void narrow(Float16* out, const float* x, std::int64_t count);

/// Converts from the type of activations.
void widen(float* out, const float* x, std::int64_t count);
void widen(float* out, const BFloat16* x, std::int64_t count);
void widen(float* out, const Float16* x, std::int64_t count);

}  // namespace stymo::kernels
