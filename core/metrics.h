#pragma once

#include "core/tensor.h"

/// Differences between two images (height, width, channels) of the same shape and type with values
/// in [0, 1]. Every function computes in float64. Throws ShapeError for different shapes and
/// TypeError for different element types.
namespace stymo {

/// Mean of |a - b| over all elements.
[[nodiscard]] double mean_absolute_error(const Tensor& a, const Tensor& b);
/// The paper's L1: |a - b| summed over the channels, averaged over the pixels.
[[nodiscard]] double l1_error(const Tensor& a, const Tensor& b);
/// Peak signal-to-noise ratio in decibels for a peak of 1; +infinity for identical images.
[[nodiscard]] double peak_signal_to_noise_ratio(const Tensor& a, const Tensor& b);
/// A higher PSNR, in decibels, is implausible for a photo; `implausible_psnr` says so.
inline constexpr double most_plausible_psnr = 60.0;
inline constexpr const char* implausible_psnr =
    ", which no photo allows: do the masks cover the heads?";
/// Structural similarity (Wang et al. 2004) in [-1, 1], mean over the channels and over the pixels
/// whose 11x11 window lies within the image: Gaussian window with deviation 1.5, K1 = 0.01, K2 =
/// 0.03, population covariance. Equals scikit-image's structural_similarity(gaussian_weights=True,
/// sigma=1.5, use_sample_covariance=False, data_range=1, channel_axis=2). Throws ShapeError for a
/// side shorter than 11 pixels. With `counted` (height, width, 1), only windows count that hold no
/// 0 of it; 1 if there are none.
[[nodiscard]] double structural_similarity(const Tensor& a, const Tensor& b,
                                           const Tensor& counted = {});

}  // namespace stymo
