#include "fit/photo/head_mask.h"

#include <algorithm>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <span>

#include "core/error.h"
#include "core/ops/shape_ops.h"
#include "fit/photo/mask_band.h"
#include "fit/photo/mask_edge.h"

namespace stymo {
namespace {

bool is_set(float value) {
    return value > 0.5F;
}

/// 255 in the largest 8-connected component, else 0.
cv::Mat largest_component(const cv::Mat& set) {
    cv::Mat components, statistics, centroids;
    const int count =
        cv::connectedComponentsWithStats(set, components, statistics, centroids, 8, CV_32S);
    int largest = 0;
    for (int i = 1; i < count; ++i)
        if (largest == 0 ||
            statistics.at<int>(i, cv::CC_STAT_AREA) > statistics.at<int>(largest, cv::CC_STAT_AREA))
            largest = i;
    return largest == 0 ? cv::Mat::zeros(set.size(), CV_8U) : cv::Mat(components == largest);
}

/// Sets the small holes of the component to 255: teeth, or glasses that mirror a window. A large
/// hole is a hand or a microphone before the face.
void fill_small_holes(cv::Mat& component) {
    constexpr double small = 0.03;
    const double largest = small * cv::countNonZero(component);
    cv::Mat components, statistics, centroids;
    const int count = cv::connectedComponentsWithStats(component == 0, components, statistics,
                                                       centroids, 4, CV_32S);
    for (int i = 1; i < count; ++i) {
        const cv::Rect box(
            statistics.at<int>(i, cv::CC_STAT_LEFT), statistics.at<int>(i, cv::CC_STAT_TOP),
            statistics.at<int>(i, cv::CC_STAT_WIDTH), statistics.at<int>(i, cv::CC_STAT_HEIGHT));
        const bool at_border = box.x == 0 || box.y == 0 || box.br().x == component.cols ||
                               box.br().y == component.rows;
        if (!at_border && statistics.at<int>(i, cv::CC_STAT_AREA) < largest)
            component.setTo(255, components == i);
    }
}

bool reaches_top(const Tensor& probability) {
    return std::ranges::any_of(
        probability.values<float>().first(static_cast<std::size_t>(probability.shape(1))), is_set);
}

/// The rows from the top of a crop with its margin to the bottom of the crop, and the crop's
/// columns.
Tensor crop_and_above(const Tensor& surrounded, std::int64_t side) {
    const std::int64_t margin = head_mask_margin(side);
    return slice(slice(Variable(surrounded), 0, 0, margin + side), 1, margin, margin + side)
        .value();
}

}  // namespace

Tensor soft_head_mask(const Tensor& probability) {
    if (probability.rank() != 3 || probability.size() == 0 || probability.shape(2) != 1)
        fail<ShapeError>("[soft_head_mask] a mask is (height, width, 1); got ",
                         probability.shape());
    const int height = static_cast<int>(probability.shape(0)),
              width = static_cast<int>(probability.shape(1));
    cv::Mat set(height, width, CV_8U);
    const std::span<const float> values = probability.values<float>();
    std::ranges::transform(values, set.begin<unsigned char>(),
                           [](float value) { return is_set(value) ? 255 : 0; });
    const cv::Mat found = largest_component(set);
    cv::Mat whole = found.clone();
    fill_small_holes(whole);
    const double band = edge_band(height, width);
    const cv::Mat inside = farther_than(band, whole), outside = farther_than(band, found == 0);
    Tensor mask = probability;
    auto value = mask.mutable_values<float>().begin();
    for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column, ++value) {
            const bool is_hole = whole.at<unsigned char>(row, column) != 0 &&
                                 found.at<unsigned char>(row, column) == 0;
            if (is_hole || inside.at<unsigned char>(row, column) != 0)
                *value = 1.0F;
            else if (outside.at<unsigned char>(row, column) != 0)
                *value = 0.0F;
        }
    return mask;
}

Tensor bounded_at_top(const Tensor& alone, const Tensor& surrounded) {
    const std::int64_t side = alone.shape(0), margin = head_mask_margin(side);
    if (!(surrounded.shape() == Shape{side + 2 * margin, side + 2 * margin, 1}))
        fail<ShapeError>("[bounded_at_top] a crop of ", alone.shape(), " within ",
                         surrounded.shape());
    Tensor result = crop_and_above(surrounded, side);
    const std::span<float> below =
        result.mutable_values<float>().subspan(static_cast<std::size_t>(margin * side));
    const std::span<const float> values = alone.values<float>();
    for (std::size_t i = 0; i < below.size(); ++i) {
        const auto row = static_cast<std::int64_t>(i) / side;
        const float distance = static_cast<float>(row) / static_cast<float>(margin);
        below[i] = std::min(values[i], below[i] + distance * distance);
    }
    return result;
}

Tensor head_mask(const HeadMaskModel& model, const Tensor& crop, const SurroundedCrop& surrounded) {
    const Tensor alone = head_probability(model, crop);
    if (!surrounded || !reaches_top(alone)) return edge_by_color(soft_head_mask(alone), crop);
    constexpr std::int64_t usual = HeadMaskNetwork::usual_side;
    const std::int64_t side = crop.shape(0), margin = head_mask_margin(side);
    const Tensor around = surrounded();
    const Tensor found = head_probability(model, around, usual + 2 * head_mask_margin(usual));
    const Tensor mask =
        edge_by_color(soft_head_mask(bounded_at_top(alone, found)), crop_and_above(around, side));
    return slice(Variable(mask), 0, margin, margin + side).value();
}

double intersection_over_union(const Tensor& a, const Tensor& b) {
    if (!(a.shape() == b.shape()))
        fail<ShapeError>("[intersection_over_union] masks differ in shape: ", a.shape(), ", ",
                         b.shape());
    const std::span<const float> first = a.values<float>();
    const std::span<const float> second = b.values<float>();
    std::int64_t both = 0;
    std::int64_t either = 0;
    for (std::size_t i = 0; i < first.size(); ++i) {
        both += is_set(first[i]) && is_set(second[i]) ? 1 : 0;
        either += is_set(first[i]) || is_set(second[i]) ? 1 : 0;
    }
    return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

double covered_share(const Tensor& mask) {
    double sum = 0.0;
    for (const float value : mask.values<float>()) sum += static_cast<double>(value);
    return mask.size() == 0 ? 0.0 : sum / static_cast<double>(mask.size());
}

}  // namespace stymo
