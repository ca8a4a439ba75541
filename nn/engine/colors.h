#pragma once

#include <cstdint>

namespace stymo::kernels {

/// to (pixels, 3) += x weight^T - background, with x (pixels, channels), weight (3, channels) and
/// background (3): the colours of feature rows. Runs on the calling thread; the instruction set is
/// chosen at run time.
void add_colors(float* to, const float* x, const float* weight, const float* background,
                std::int64_t pixels, std::int64_t channels);

}  // namespace stymo::kernels
