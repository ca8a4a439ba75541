#pragma once

#include <optional>
#include <vector>

#include "core/io/json_writer.h"
#include "core/tensor.h"
#include "nn/pretrained/perceptual/lpips.h"

namespace stymo {

/// The paper's metrics of one image against its target. Both are masked (black outside the head),
/// and means are over the full frame, or the part of it that is known in the photo.
struct ImageMetrics {
    double l1 = 0.0;       ///< summed over RGB, as in the paper's tables
    double l1_mean = 0.0;  ///< averaged over RGB
    double ssim = 0.0;
    double psnr = 0.0;              ///< decibels; infinite for identical images
    std::optional<double> lpips{};  ///< empty: not measured
};

/// A target image with values that are computed only once for it.
class MetricTarget {
public:
    /// target (S, S, 3) and mask (S, S, 1), all in [0, 1]. `lpips` must outlive this object; null:
    /// LPIPS is not measured. `known` (S, S, 1) as in nn/known_pixels.h.
    MetricTarget(const Tensor& target, const Tensor& mask, const Lpips* lpips = nullptr,
                 const Tensor& known = {});

    /// image (S, S, 3) in [0, 1].
    [[nodiscard]] ImageMetrics measure(const Tensor& image) const;

private:
    Tensor masked_target_;
    Tensor mask_;  ///< 0 where a pixel is unknown
    Tensor known_;
    const Lpips* lpips_;
    Lpips::Features features_;
};

/// Converts an image (S, S, 3) in [0, 1] to the input of LPIPS, (1, S, S, 3) in [-1, 1].
[[nodiscard]] Tensor lpips_input(const Tensor& image);

/// The mean or median of each metric separately; LPIPS over the faces where it was measured. Zeros
/// for an empty list.
[[nodiscard]] ImageMetrics mean(const std::vector<ImageMetrics>& metrics);
[[nodiscard]] ImageMetrics median(const std::vector<ImageMetrics>& metrics);
/// {"l1", "l1_mean", "ssim", "psnr"} and, if it was measured, "lpips".
[[nodiscard]] JsonValue to_json(const ImageMetrics& metrics);

}  // namespace stymo
