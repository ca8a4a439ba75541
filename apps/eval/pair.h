#pragma once

#include <filesystem>

#include "apps/common/tool_options.h"

namespace stymo {

struct PairOptions {
    std::filesystem::path a;
    std::filesystem::path b;
    LpipsOptions lpips;
};

/// Compares two images of the same size without a mask: L1, SSIM, PSNR, and, if a network is given,
/// LPIPS and its terms.
[[nodiscard]] AppResult compare_pair(const PairOptions& options);

}  // namespace stymo
