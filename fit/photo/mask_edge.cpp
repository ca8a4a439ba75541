#include "fit/photo/mask_edge.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/error.h"
#include "fit/photo/mask_band.h"

namespace stymo {
namespace {

constexpr double radius_of_side = 0.03;  ///< of the squares in which colours are averaged

/// Of the selected pixels in a square around each pixel: their mean colour, the standard deviation
/// from it, and how much of that square they fill.
struct LocalColor {
    cv::Mat mean;
    cv::Mat deviation;
    cv::Mat share;
};

LocalColor local_color(const cv::Mat& image, const cv::Mat& selected, int window) {
    const cv::Size square(window, window);
    LocalColor result{cv::Mat::zeros(image.size(), CV_32FC3), cv::Mat(image.size(), CV_32F), {}};
    image.copyTo(result.mean, selected);
    cv::Mat squares = result.mean.mul(result.mean);
    cv::blur(result.mean, result.mean, square);
    cv::blur(squares, squares, square);
    selected.convertTo(result.share, CV_32F, 1.0 / 255.0);
    cv::blur(result.share, result.share, square);
    for (int row = 0; row < image.rows; ++row)
        for (int column = 0; column < image.cols; ++column) {
            const float share = std::max(result.share.at<float>(row, column), 1e-6F);
            cv::Vec3f& mean = result.mean.at<cv::Vec3f>(row, column);
            mean /= share;
            const cv::Vec3f square_sum = squares.at<cv::Vec3f>(row, column) / share;
            result.deviation.at<float>(row, column) = std::sqrt(
                std::max(square_sum[0] + square_sum[1] + square_sum[2] - mean.dot(mean), 0.0F));
        }
    return result;
}

/// Whether what is around may be the head's skin in less light, in [0, 1]: the shadow of a chin on
/// the neck is no edge.
float shaded_skin(const cv::Vec3f& head, const cv::Vec3f& around) {
    constexpr float least_light = 1e-3F;
    const float head_light = std::max(head[0] + head[1] + head[2], least_light),
                light = std::max(around[0] + around[1] + around[2], least_light);
    const cv::Vec3f head_hue = head / head_light, hue = around / light;
    constexpr float least_red = 0.03F;  // more red than blue; 0 is grey
    constexpr float same_hue = 0.03F, other_hue = 0.08F, brighter = 1.15F;
    const float red = std::min(head_hue[0] - head_hue[2], hue[0] - hue[2]);
    const auto distance = static_cast<float>(cv::norm(head_hue - hue));
    const auto share = [](float x) { return std::clamp(x, 0.0F, 1.0F); };
    return share(red / least_red - 1.0F) * share((other_hue - distance) / (other_hue - same_hue)) *
           share((brighter - light / head_light) / (brighter - 1.0F));
}

/// The head's share in the colour of a pixel, and how far it can be trusted, both in [0, 1].
struct HeadShare {
    float value;
    float trust;
};

HeadShare head_share(const cv::Vec3f& color, const cv::Vec3f& head, const cv::Vec3f& around,
                     float deviation) {
    constexpr float no_contrast = 0.12F, full_contrast = 0.3F, rest_of_contrast = 0.6F;
    const cv::Vec3f difference = head - around;
    const float squared = difference.dot(difference), contrast = std::sqrt(squared);
    if (contrast <= no_contrast) return {0.0F, 0.0F};
    const float value = std::clamp((color - around).dot(difference) / squared, 0.0F, 1.0F);
    const auto rest = static_cast<float>(cv::norm(color - around - difference * value));
    const float differs = std::min((contrast - no_contrast) / (full_contrast - no_contrast), 1.0F);
    const float explained = std::max(1.0F - rest / (rest_of_contrast * contrast), 0.0F);
    // A mean of several colours, as of a neck and a collar, is none of them.
    const float uniform = std::clamp(1.5F - deviation / (0.4F * contrast), 0.0F, 1.0F);
    return {value, differs * explained * uniform * (1.0F - shaded_skin(head, around))};
}

/// Values in the band are at most the highest one beside them nearer to the head. What grows again
/// behind a gap, as a neck behind the shadow of a chin, is something else: the more it would grow,
/// the less of it is head.
void never_grow_outwards(cv::Mat& values, const cv::Mat& head, const cv::Mat& around) {
    cv::Mat distances;
    cv::distanceTransform(head == 0, distances, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    std::vector<cv::Point> band;
    for (int row = 0; row < values.rows; ++row)
        for (int column = 0; column < values.cols; ++column)
            if (head.at<unsigned char>(row, column) == 0 &&
                around.at<unsigned char>(row, column) == 0)
                band.emplace_back(column, row);
    std::ranges::stable_sort(band, {}, [&](const cv::Point& p) { return distances.at<float>(p); });
    for (const cv::Point& pixel : band) {
        float highest = 0.0F;
        for (int row = std::max(pixel.y - 1, 0); row <= std::min(pixel.y + 1, values.rows - 1);
             ++row)
            for (int column = std::max(pixel.x - 1, 0);
                 column <= std::min(pixel.x + 1, values.cols - 1); ++column)
                if (distances.at<float>(row, column) < distances.at<float>(pixel))
                    highest = std::max(highest, values.at<float>(row, column));
        float& value = values.at<float>(pixel);
        const float most = highest < 0.5F ? 2.0F * highest - value : highest;
        value = std::clamp(most, 0.0F, value);
    }
}

/// The values with an edge of `width` pixels around 0.5, unless theirs is narrower.
cv::Mat crisp_edge(const cv::Mat& values, double width) {
    const cv::Mat inside = values > 0.5;
    const cv::Mat surely_head = farther_than(0.5 * width + 0.5, inside),
                  surely_not = farther_than(0.5 * width + 0.5, inside == 0);
    cv::Mat across, down, slopes;
    cv::Scharr(values, across, CV_32F, 1, 0, 1.0 / 32.0);
    cv::Scharr(values, down, CV_32F, 0, 1, 1.0 / 32.0);
    cv::magnitude(across, down, slopes);
    // At the ends of an edge the slope is that of its middle.
    cv::dilate(slopes, slopes, cv::Mat::ones(3, 3, CV_8U));
    cv::Mat result(values.size(), CV_32F);
    for (int row = 0; row < values.rows; ++row)
        for (int column = 0; column < values.cols; ++column) {
            const float slope = static_cast<float>(width) * slopes.at<float>(row, column);
            const float gain = std::max(1.0F / std::max(slope, 1e-6F), 1.0F);
            result.at<float>(row, column) =
                std::clamp(0.5F + gain * (values.at<float>(row, column) - 0.5F), 0.0F, 1.0F);
        }
    result.setTo(1.0F, surely_head);
    result.setTo(0.0F, surely_not);
    return result;
}

}  // namespace

Tensor edge_by_color(const Tensor& mask, const Tensor& image) {
    if (mask.rank() != 3 || mask.size() == 0 || mask.shape(2) != 1 ||
        image.shape() != Shape{mask.shape(0), mask.shape(1), 3})
        fail<ShapeError>(
            "[edge_by_color] a mask is (height, width, 1) and its image (height, width, 3); got ",
            mask.shape(), " and ", image.shape());
    const int height = static_cast<int>(mask.shape(0)), width = static_cast<int>(mask.shape(1));
    const int side = std::max(height, width);
    Tensor result = mask, colors = image;
    cv::Mat values(height, width, CV_32F, result.mutable_values<float>().data());
    const cv::Mat pixels(height, width, CV_32FC3, colors.mutable_values<float>().data());

    const double band = edge_band(height, width);
    const cv::Mat inside = values > 0.5;
    const cv::Mat head = farther_than(band, inside), around = farther_than(band, inside == 0);

    const cv::Mat crisp = crisp_edge(values, std::max(2.5, side / 100.0));

    // From each rim of the band the square reaches across it.
    const int radius = std::max(static_cast<int>(side * radius_of_side),
                                2 * static_cast<int>(std::ceil(band)) + 1);
    const int window = 2 * radius + 1;
    const LocalColor of_head = local_color(pixels, head, window),
                     of_around = local_color(pixels, around, window);
    constexpr float enough = 1e-3F;  // of a window
    for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column) {
            const bool is_edge = head.at<unsigned char>(row, column) == 0 &&
                                 around.at<unsigned char>(row, column) == 0;
            if (!is_edge || of_head.share.at<float>(row, column) < enough ||
                of_around.share.at<float>(row, column) < enough)
                continue;
            const HeadShare share = head_share(pixels.at<cv::Vec3f>(row, column),
                                               of_head.mean.at<cv::Vec3f>(row, column),
                                               of_around.mean.at<cv::Vec3f>(row, column),
                                               of_around.deviation.at<float>(row, column));
            float& value = values.at<float>(row, column);
            const float found = value;
            value = crisp.at<float>(row, column);
            const float wanted = found > 0.5F ? share.value : std::min(share.value, found);
            value += share.trust * (wanted - value);
        }
    never_grow_outwards(values, head, around);
    return result;
}

}  // namespace stymo
