#include "fit/evaluation.h"

#include <cmath>
#include <numeric>

#include "core/median.h"
#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "nn/known_pixels.h"
#include "nn/models/display_image.h"

namespace stymo {

namespace {

/// `average` of each metric; it is never given no values.
template <class Average>
ImageMetrics averaged(const std::vector<ImageMetrics>& metrics, const Average& average) {
    ImageMetrics result;
    if (metrics.empty()) return result;
    for (double ImageMetrics::*member :
         {&ImageMetrics::l1, &ImageMetrics::l1_mean, &ImageMetrics::ssim, &ImageMetrics::psnr}) {
        std::vector<double> values;
        for (const ImageMetrics& one : metrics) values.push_back(one.*member);
        result.*member = average(values);
    }
    std::vector<double> distances;
    for (const ImageMetrics& one : metrics)
        if (one.lpips) distances.push_back(*one.lpips);
    if (!distances.empty()) result.lpips = average(distances);
    return result;
}

}  // namespace

MetricTarget::MetricTarget(const Tensor& target, const Tensor& mask, const Lpips* lpips,
                           const Tensor& known)
    : masked_target_(masked_image(target, where_known(known, mask, 0.0).value())),
      mask_(where_known(known, mask, 0.0).value()),
      known_(known),
      lpips_(lpips) {
    if (lpips_ != nullptr) features_ = lpips_->features(lpips_input(masked_target_));
}

ImageMetrics MetricTarget::measure(const Tensor& image) const {
    const Tensor& b = masked_target_;
    const Tensor a = masked_image(image, mask_);
    ImageMetrics metrics{l1_error(a, b), mean_absolute_error(a, b),
                         structural_similarity(a, b, known_), peak_signal_to_noise_ratio(a, b)};
    if (lpips_ != nullptr)
        metrics.lpips =
            lpips_->distance(lpips_->features(lpips_input(a)), features_).value().item();
    if (!known_.defined()) return metrics;
    // Unknown pixels are black in both images.
    const double share = known_share(known_);
    metrics.l1 /= share;
    metrics.l1_mean /= share;
    metrics.psnr += 10.0 * std::log10(share);
    if (metrics.lpips) *metrics.lpips /= share;
    return metrics;
}

Tensor lpips_input(const Tensor& image) {
    return affine(image.reshaped({1, image.shape(0), image.shape(1), 3}), 2.0, -1.0).value();
}

ImageMetrics mean(const std::vector<ImageMetrics>& metrics) {
    return averaged(metrics, [](const std::vector<double>& values) {
        return std::accumulate(values.begin(), values.end(), 0.0) /
               static_cast<double>(values.size());
    });
}

ImageMetrics median(const std::vector<ImageMetrics>& metrics) {
    return averaged(metrics, [](const std::vector<double>& values) { return median(values); });
}

JsonValue to_json(const ImageMetrics& metrics) {
    JsonValue json = JsonValue::object({{"l1", metrics.l1},
                                        {"l1_mean", metrics.l1_mean},
                                        {"ssim", metrics.ssim},
                                        {"psnr", metrics.psnr}});
    if (metrics.lpips) json.add("lpips", *metrics.lpips);
    return json;
}

}  // namespace stymo
