#include "fit/evaluation.h"

#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "nn/models/picture.h"

namespace stymo {

MetricTarget::MetricTarget(const Tensor& target, const Tensor& mask, const Lpips* lpips)
    : masked_target_(masked_picture(target, mask)), mask_(mask), lpips_(lpips) {
    if (lpips_ != nullptr) features_ = lpips_->features(lpips_input(masked_target_));
}

ImageMetrics MetricTarget::measure(const Tensor& picture) const {
    const Tensor& b = masked_target_;
    const Tensor a = masked_picture(picture, mask_);
    ImageMetrics metrics{l1_error(a, b), mean_absolute_error(a, b), structural_similarity(a, b),
                         peak_signal_to_noise_ratio(a, b)};
    if (lpips_ != nullptr) metrics.lpips = lpips_->distance(lpips_->features(lpips_input(a)), features_).value().item();
    return metrics;
}

Tensor lpips_input(const Tensor& picture) {
    return affine(picture.reshaped({1, picture.shape(0), picture.shape(1), 3}), 2.0, -1.0).value();
}

ImageMetrics mean(const std::vector<ImageMetrics>& metrics) {
    ImageMetrics total;
    const auto count = static_cast<double>(metrics.size());
    for (const ImageMetrics& one : metrics) {
        total.l1 += one.l1 / count;
        total.l1_mean += one.l1_mean / count;
        total.ssim += one.ssim / count;
        total.psnr += one.psnr / count;
        if (one.lpips) total.lpips = total.lpips.value_or(0.0) + *one.lpips / count;
    }
    return total;
}

JsonValue to_json(const ImageMetrics& metrics) {
    JsonValue json =
        JsonValue::object({{"l1", metrics.l1}, {"l1_mean", metrics.l1_mean}, {"ssim", metrics.ssim}, {"psnr", metrics.psnr}});
    if (metrics.lpips) json.add("lpips", *metrics.lpips);
    return json;
}

}  // namespace stymo
