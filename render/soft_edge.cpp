#include "render/soft_edge.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/ops/elementwise.h"

namespace stymo {

Tensor soft_opacity(const Tensor& mask) {
    constexpr float trained = 0.9F;
    constexpr double smoothed_at_256 = 1.0;
    if (std::ranges::max(mask.values<float>()) < trained) return Tensor::full(mask.shape(), 1.0);
    const auto side = static_cast<int>(mask.shape(0));
    Tensor opacity = mask;
    cv::Mat smooth(side, side, CV_32F, opacity.mutable_values<float>().data());
    cv::GaussianBlur(smooth, smooth, {}, std::max(smoothed_at_256 * side / 256.0, 0.3));
    for (float& value : opacity.mutable_values<float>()) {
        const float t = std::clamp(2.0F * value - 1.0F, 0.0F, 1.0F);
        value = t * t * (3.0F - 2.0F * t);
    }
    return opacity;
}

Tensor with_soft_edge(const Tensor& image, const Tensor& mask) {
    return (Variable(image) * soft_opacity(mask)).value();
}

}  // namespace stymo
