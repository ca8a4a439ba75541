#include "train/data/augmented_face.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace stymo {

namespace {

constexpr int points = 5;
constexpr double stretch_deviation = 0.05, point_deviation = 0.015;
constexpr double power_deviation = 0.2, factor_deviation = 0.05, brightness_deviation = 0.1,
                 saturation_deviation = 0.15;
/// Rec. 709.
constexpr std::array<float, 3> luminance_weights{0.2126F, 0.7152F, 0.0722F};

cv::Mat as_mat(const Tensor& image) {
    return {static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)),
            CV_MAKETYPE(CV_32F, static_cast<int>(image.shape(2))),
            const_cast<float*>(image.values<float>().data())};
}

/// Normal, but never more than twice the deviation.
double moderate(Rng& rng, double deviation) {
    return deviation * std::clamp(rng.normal(), -2.0, 2.0);
}

/// For each pixel of the result the pixel coordinates of what it shows.
cv::Mat source_points(int side, Rng& rng) {
    cv::Mat grid(points, points, CV_32FC2), moves;
    for (int i = 0; i < points * points; ++i)
        grid.at<cv::Vec2f>(i / points, i % points) = {
            static_cast<float>(moderate(rng, point_deviation * side)),
            static_cast<float>(moderate(rng, point_deviation * side))};
    cv::resize(grid, moves, {side, side}, 0, 0, cv::INTER_CUBIC);
    const double stretch_x = std::exp(moderate(rng, stretch_deviation));
    const double stretch_y = std::exp(moderate(rng, stretch_deviation));
    const double middle = 0.5 * (side - 1);
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column)
            moves.at<cv::Vec2f>(row, column) +=
                cv::Vec2f(static_cast<float>(middle + (column - middle) / stretch_x),
                          static_cast<float>(middle + (row - middle) / stretch_y));
    return moves;
}

Tensor remapped(const Tensor& image, const cv::Mat& from, int interpolation) {
    Tensor result(image.shape());
    cv::Mat target = as_mat(result);
    cv::remap(as_mat(image), target, from, cv::noArray(), interpolation, cv::BORDER_REPLICATE);
    for (float& value : result.mutable_values<float>()) value = std::clamp(value, 0.0F, 1.0F);
    return result;
}

/// The known pixels: those of the photo that are shown entirely.
Tensor remapped_known(const Face& face, const cv::Mat& from) {
    const Tensor known = face.known.defined() ? face.known : Tensor::full(face.mask.shape(), 1.0);
    Tensor result(face.mask.shape());
    cv::Mat target = as_mat(result);
    // A pixel's centre up to half a pixel outside the outermost centres is still in the photo.
    cv::remap(as_mat(known), target, from, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
    for (float& value : result.mutable_values<float>()) value = value > 0.999F ? 1.0F : 0.0F;
    return result;
}

}  // namespace

Face bent(const Face& face, Rng rng) {
    const cv::Mat from = source_points(static_cast<int>(face.image.shape(0)), rng);
    Face result = face;
    result.image = remapped(face.image, from, cv::INTER_CUBIC);
    result.mask = remapped(face.mask, from, cv::INTER_LINEAR);
    result.known = remapped_known(face, from);
    return result;
}

Face recolored(const Face& face, Rng rng) {
    const auto power = static_cast<float>(std::exp(moderate(rng, power_deviation)));
    const auto saturation = static_cast<float>(std::exp(moderate(rng, saturation_deviation)));
    const double brightness = moderate(rng, brightness_deviation);
    std::array<float, 3> factors{};
    for (float& factor : factors)
        factor = static_cast<float>(std::exp(brightness + moderate(rng, factor_deviation)));

    Face result = face;
    result.image = Tensor(face.image.shape());
    const std::span<const float> from = face.image.values<float>();
    const std::span<float> to = result.image.mutable_values<float>();
    for (std::size_t pixel = 0; pixel + 2 < from.size(); pixel += 3) {
        std::array<float, 3> color{};
        float luminance = 0.0F;
        for (std::size_t i = 0; i < 3; ++i) {
            color[i] = factors[i] * std::pow(from[pixel + i], power);
            luminance += luminance_weights[i] * color[i];
        }
        for (std::size_t i = 0; i < 3; ++i)
            to[pixel + i] = std::clamp(luminance + saturation * (color[i] - luminance), 0.0F, 1.0F);
    }
    return result;
}

}  // namespace stymo
