#include "fit/photo/head_mask.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/error.h"
#include "render/parsing_classes.h"

namespace stymo {
namespace {

constexpr unsigned char background = 0;
constexpr unsigned char hair = 1;
constexpr unsigned char face = 2;

void require_one_channel(const Tensor& image, const char* operation) {
    if (image.rank() != 3 || image.size() == 0 || image.shape(2) != 1)
        fail<ShapeError>("[", operation, "] a mask is (height, width, 1); got ", image.shape());
}

/// Sets all pixels outside the largest 8-connected component to 0.
void keep_largest_component(cv::Mat& labels) {
    cv::Mat components, statistics, centroids;
    const int count = cv::connectedComponentsWithStats(labels != background, components, statistics,
                                                       centroids, 8, CV_32S);
    int largest = 0;
    for (int i = 1; i < count; ++i)
        if (largest == 0 ||
            statistics.at<int>(i, cv::CC_STAT_AREA) > statistics.at<int>(largest, cv::CC_STAT_AREA))
            largest = i;
    if (largest > 0) labels.setTo(background, components != largest);
}

/// Removes hair that touches the background more than the face.
void take_back_hair(cv::Mat& labels) {
    cv::Mat around;
    const cv::Matx33f cross(0, 1, 0, 1, 0, 1, 0, 1, 0);
    cv::filter2D(labels, around, CV_32F, cross * 0.25F, {-1, -1}, 0, cv::BORDER_REPLICATE);
    labels.setTo(background, (labels == hair) & (around < 0.99F));
}

/// Fills the holes: pixels from which the border of the frame cannot be reached.
void fill_holes(cv::Mat& labels) {
    cv::Mat components, statistics, centroids;
    const int count = cv::connectedComponentsWithStats(labels == background, components, statistics,
                                                       centroids, 4, CV_32S);
    for (int i = 1; i < count; ++i) {
        const int left = statistics.at<int>(i, cv::CC_STAT_LEFT);
        const int top = statistics.at<int>(i, cv::CC_STAT_TOP);
        const bool at_rim = left == 0 || top == 0 ||
                            left + statistics.at<int>(i, cv::CC_STAT_WIDTH) == labels.cols ||
                            top + statistics.at<int>(i, cv::CC_STAT_HEIGHT) == labels.rows;
        if (!at_rim) labels.setTo(face, components == i);
    }
}

Tensor mask_from_classes(const cv::Mat& labels) {
    Tensor mask({labels.rows, labels.cols, 1});
    std::transform(labels.begin<unsigned char>(), labels.end<unsigned char>(),
                   mask.mutable_values<float>().begin(),
                   [](unsigned char label) { return label == background ? 0.0F : 1.0F; });
    return mask;
}

cv::Mat labels_of(const Tensor& image, unsigned char (*label)(float)) {
    cv::Mat labels(static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)), CV_8U);
    const std::span<const float> values = image.values<float>();
    std::transform(values.begin(), values.end(), labels.begin<unsigned char>(), label);
    return labels;
}

bool is_set(float value) {
    return value > 0.5F;
}

}  // namespace

Tensor head_mask_from_parsing(const Tensor& classes) {
    require_one_channel(classes, "head_mask_from_parsing");
    cv::Mat labels = labels_of(classes, [](float value) {
        const auto index = static_cast<int>(value);
        if (index == static_cast<int>(ParsingClass::hair)) return hair;
        return is_head_class(index) ? face : background;
    });
    keep_largest_component(labels);
    const auto steps = static_cast<int>(std::lround(7.0 * labels.rows / 512.0));
    for (int i = 0; i < steps; ++i) take_back_hair(labels);
    keep_largest_component(labels);
    return mask_from_classes(labels);
}

Tensor clean_head_mask(const Tensor& mask) {
    require_one_channel(mask, "clean_head_mask");
    cv::Mat labels = labels_of(mask, [](float value) { return is_set(value) ? face : background; });
    keep_largest_component(labels);
    fill_holes(labels);
    return mask_from_classes(labels);
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
