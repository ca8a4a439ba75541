#include "fit/evaluation.h"

#include "core/metrics.h"
#include "nn/models/picture.h"

namespace stymo {

ImageMetrics measure(const Tensor& picture, const Tensor& target, const Tensor& mask) {
    const Tensor a = masked_picture(picture, mask);
    const Tensor b = masked_picture(target, mask);
    return {l1_error(a, b), mean_absolute_error(a, b), structural_similarity(a, b), peak_signal_to_noise_ratio(a, b)};
}

ImageMetrics mean(const std::vector<ImageMetrics>& metrics) {
    ImageMetrics total;
    const auto count = static_cast<double>(metrics.size());
    for (const ImageMetrics& one : metrics) {
        total.l1 += one.l1 / count;
        total.l1_mean += one.l1_mean / count;
        total.ssim += one.ssim / count;
        total.psnr += one.psnr / count;
    }
    return total;
}

JsonValue to_json(const ImageMetrics& metrics) {
    return JsonValue::object({{"l1", metrics.l1}, {"l1_mean", metrics.l1_mean}, {"ssim", metrics.ssim}, {"psnr", metrics.psnr}});
}

}  // namespace stymo
