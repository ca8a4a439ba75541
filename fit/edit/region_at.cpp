#include "fit/edit/region_at.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

namespace stymo {

namespace {

/// Largest distances in L, a, b from the colour of the point for close colours. Shading changes
/// lightness more than hue.
const cv::Scalar close_in_lab(18.0, 7.0, 7.0);
/// Radius of the blur that smooths hair and noise before colours are compared, as a share of the
/// image's side.
constexpr double blur_share = 1.0 / 64.0;

}  // namespace

Tensor region_at(const Tensor& image, double x, double y, double reach) {
    if (image.rank() != 3 || image.shape(0) != image.shape(1) || image.shape(2) != 3)
        fail<ShapeError>("[region_at] needs (S, S, 3), got ", image.shape());
    if (!(x >= 0.0 && x <= 1.0 && y >= 0.0 && y <= 1.0))
        fail<ValueError>("the point (", x, ", ", y, ") is outside the image");
    if (!(reach > 0.0)) fail<ValueError>("the reach must be positive, got ", reach);
    const int side = static_cast<int>(image.shape(0));
    Tensor pixels = image;
    const cv::Mat rgb(side, side, CV_32FC3, pixels.mutable_values<float>().data());
    cv::Mat lab;
    cv::cvtColor(rgb, lab, cv::COLOR_RGB2Lab);
    cv::GaussianBlur(lab, lab, {}, std::max(0.5, blur_share * side));
    const cv::Point seed(std::min(static_cast<int>(x * side), side - 1),
                         std::min(static_cast<int>(y * side), side - 1));
    cv::Mat mask = cv::Mat::zeros(side + 2, side + 2, CV_8U);
    const cv::Scalar range = close_in_lab * reach;
    constexpr int filled = 1 << 8;
    cv::floodFill(lab, mask, seed, {}, nullptr, range, range,
                  4 | cv::FLOODFILL_MASK_ONLY | cv::FLOODFILL_FIXED_RANGE | filled);
    Tensor result({side, side, 1});
    const std::span<float> values = result.mutable_values<float>();
    for (int row = 0; row < side; ++row) {
        for (int column = 0; column < side; ++column)
            values[static_cast<std::size_t>(row) * static_cast<std::size_t>(side) +
                   static_cast<std::size_t>(column)] =
                mask.at<std::uint8_t>(row + 1, column + 1) != 0 ? 1.0F : 0.0F;
    }
    return result;
}

}  // namespace stymo
