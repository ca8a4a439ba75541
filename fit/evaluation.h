#pragma once

#include <vector>

#include "core/io/json_writer.h"
#include "core/tensor.h"

namespace stymo {

/// The paper's metrics of one picture against its target, both masked (black outside the head) and averaged over the full frame.
struct ImageMetrics {
    double l1 = 0.0;       ///< summed over RGB, as in the paper's tables
    double l1_mean = 0.0;  ///< averaged over RGB
    double ssim = 0.0;
    double psnr = 0.0;  ///< decibels; infinite for identical pictures
};

/// picture, target (S, S, 3) and mask (S, S, 1), all in [0, 1].
[[nodiscard]] ImageMetrics measure(const Tensor& picture, const Tensor& target, const Tensor& mask);
[[nodiscard]] ImageMetrics mean(const std::vector<ImageMetrics>& metrics);
[[nodiscard]] JsonValue to_json(const ImageMetrics& metrics);

}  // namespace stymo
