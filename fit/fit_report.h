#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "core/tensor.h"
#include "fit/fitter.h"
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

/// Images and metrics of a fit.
struct FitReport {
    Tensor target;   ///< (S, S, 3) in [0, 1], masked
    Tensor initial;  ///< rendered from the initial codes
    Tensor fitted;   ///< rendered from the fitted codes
    Tensor mask;  ///< (S, S, 1): the model's head mask for the fitted codes; undefined unless asked
                  ///< for, and below the model's resolution
    ImageMetrics initial_metrics;
    ImageMetrics fitted_metrics;
    Tensor tuned{};  ///< rendered by the tuned decoder; undefined without one
    ImageMetrics tuned_metrics{};
    double counting_samples = 1.0;  ///< View::significant_samples of the fitted face
    std::string lpips_network;      ///< Lpips::label(); empty: LPIPS was not measured
};

/// The known pixels of the largest target of row `index`, (S, S, 1); undefined: all.
[[nodiscard]] Tensor known_in(const FaceBatch& target, std::int64_t index);
/// The first face's largest target for display, with guesses in place of its unknown pixels.
[[nodiscard]] Tensor photo_with_guesses(const FaceBatch& target);

/// Renders row `index` before and after the fit and measures both within `mask` (B, S, S, 1), with
/// LPIPS unless `lpips` is null. If the fit changed nothing, only one image is rendered.
/// `with_head_mask`: also renders the model's head mask.
[[nodiscard]] FitReport report_fit(const Model& model, const FaceBatch& target, const Tensor& mask,
                                   const FitResult& result, std::int64_t index,
                                   const Lpips* lpips = nullptr, bool with_head_mask = false);
/// Adds the image of the tuned decoder to the report of row `index`, and replaces the mask by that
/// of the tuned decoder. The other arguments are those of `report_fit`.
void add_tuned(FitReport& report, const Model& tuned, const FaceBatch& target, const Tensor& mask,
               const FitResult& result, std::int64_t index, const Lpips* lpips);
/// {"initial": {...}, "fitted": {...}, "tuned": {...} if there is one, "lpips_network" if it was
/// measured, "steps", "seconds", "loss": [...]}
[[nodiscard]] JsonValue to_json(const FitReport& report, const FitResult& result, double seconds);
/// target | initial | fitted | tuned if there is one | mask if there is one
[[nodiscard]] Tensor comparison_sheet(const FitReport& report);

}  // namespace stymo
