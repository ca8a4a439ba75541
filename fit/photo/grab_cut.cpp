#include "fit/photo/grab_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/image_bytes.h"
#include "fit/photo/head_mask.h"

namespace stymo {
namespace {

constexpr int side = 128;  ///< side of the copy that is segmented

/// The position of a head in pixels of the upright copy, from the landmarks.
struct HeadPosition {
    Landmarks landmarks;
    double center_x;
    double eyes_y;
    double brows_y;
    double jaw_width;
    double eyes_to_chin;
};

HeadPosition head_position(const Landmarks& landmarks) {
    const Eigen::Vector2d left_eye = mean_landmark(landmarks, 36, 41);
    const Eigen::Vector2d right_eye = mean_landmark(landmarks, 42, 47);
    const double eyes_x = (left_eye[0] + right_eye[0]) / 2;
    const double eyes_y = (left_eye[1] + right_eye[1]) / 2;
    return {landmarks,
            (landmarks[0][0] + landmarks[16][0] + 2 * eyes_x) / 4,
            eyes_y,
            mean_landmark(landmarks, 17, 26)[1],
            landmarks[16][0] - landmarks[0][0],
            landmarks[8][1] - eyes_y};
}

double logistic(double x) {
    return 1.0 / (1.0 + std::exp(-x));
}

float log_odds(double probability) {
    return static_cast<float>(std::log(probability / (1.0 - probability)));
}

/// Log odds that a pixel belongs to the head, from its position alone: an ellipse around the skull,
/// and hair that may fall beside the face.
cv::Mat log_odds_of_position(const HeadPosition& head) {
    constexpr double half_width = 0.70;
    constexpr double half_height = 1.15;
    constexpr double border = 1.08;
    constexpr double softness = 0.12;
    constexpr double falling_hair = 0.45;
    constexpr double reach_of_hair = 1.1;
    cv::Mat result(side, side, CV_32F);
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column) {
            const double across = std::abs(column + 0.5 - head.center_x) / head.jaw_width;
            const double down = (row + 0.5 - head.eyes_y) / head.eyes_to_chin;
            const double skull =
                logistic((border - std::hypot(across / half_width, down / half_height)) / softness);
            const double hair =
                down > 0.0 ? falling_hair * logistic((reach_of_hair - across) / 0.1) : 0.0;
            result.at<float>(row, column) = log_odds(std::clamp(std::max(skull, hair), 0.02, 0.98));
        }
    return result;
}

cv::Point pixel_at(double x, double y) {
    return {cvRound(x - 0.5), cvRound(y - 0.5)};
}

void fill(cv::Mat& mask, const std::vector<cv::Point>& polygon) {
    cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{polygon}, cv::Scalar(255));
}

/// The convex hull of the landmarks and the forehead above it.
cv::Mat face_of(const HeadPosition& head) {
    cv::Mat face = cv::Mat::zeros(side, side, CV_8U);
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& point : head.landmarks)
        points.push_back(pixel_at(point[0], point[1]));
    std::vector<cv::Point> hull;
    cv::convexHull(points, hull);
    fill(face, hull);
    const cv::Size forehead(cvRound(0.38 * head.jaw_width), cvRound(0.55 * head.eyes_to_chin));
    cv::ellipse(face, pixel_at(head.center_x, head.brows_y), forehead, 0, 180, 360, cv::Scalar(255),
                cv::FILLED);
    return face;
}

/// The region below the chin. The neck has the colour of the face, so only its position
/// distinguishes it from the head.
cv::Mat neck_of(const HeadPosition& head) {
    cv::Mat neck = cv::Mat::zeros(side, side, CV_8U);
    std::vector<cv::Point> points;
    for (std::size_t i = 4; i <= 12; ++i)
        points.push_back(
            pixel_at(head.landmarks[i][0], head.landmarks[i][1] + 0.05 * head.eyes_to_chin));
    points.push_back(pixel_at(head.center_x + 0.2 * head.jaw_width, side + 1.0));
    points.push_back(pixel_at(head.center_x - 0.2 * head.jaw_width, side + 1.0));
    fill(neck, points);
    return neck;
}

cv::Mat bytes_of(const Tensor& image) {
    const std::vector<std::uint8_t> bytes = image_bytes(image);
    cv::Mat result(static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)), CV_8UC3);
    std::copy(bytes.begin(), bytes.end(), result.data);
    return result;
}

/// Colours of an image in cells of 1/16 of L and 8 units of a and b of CIE Lab.
class ColorCells {
public:
    explicit ColorCells(const cv::Mat& image) : cells_(side, side, CV_32S) {
        cv::Mat lab;
        cv::cvtColor(image, lab, cv::COLOR_RGB2Lab);
        const auto chroma = [](int value) { return std::clamp((value - 64) / 8, 0, across - 1); };
        std::transform(lab.begin<cv::Vec3b>(), lab.end<cv::Vec3b>(), cells_.begin<int>(),
                       [&](const cv::Vec3b& color) {
                           return (color[0] * across / 256 * across + chroma(color[1])) * across +
                                  chroma(color[2]);
                       });
    }

    /// Log of the ratio of the likelihoods of a pixel's colour among pixels with weights `a` and
    /// with weights `b`.
    [[nodiscard]] cv::Mat log_ratio(const cv::Mat& a, const cv::Mat& b) const {
        const std::vector<float> of_a = density(a);
        const std::vector<float> of_b = density(b);
        cv::Mat result(side, side, CV_32F);
        std::transform(cells_.begin<int>(), cells_.end<int>(), result.begin<float>(),
                       [&](int cell) {
                           const auto index = static_cast<std::size_t>(cell);
                           return std::log(of_a[index] / of_b[index]);
                       });
        cv::GaussianBlur(result, result, {}, 0.8 * side / 96.0);
        return result;
    }

private:
    static constexpr int across = 16;

    [[nodiscard]] std::vector<float> density(const cv::Mat& weights) const {
        const std::array<int, 3> extents = {across, across, across};
        cv::Mat counts = cv::Mat::zeros(3, extents.data(), CV_32F);
        auto weight = weights.begin<float>();
        for (auto cell = cells_.begin<int>(); cell != cells_.end<int>(); ++cell, ++weight)
            counts.ptr<float>()[*cell] += *weight;
        std::vector<float> values(counts.ptr<float>(), counts.ptr<float>() + counts.total());
        for (const std::size_t stride :
             {std::size_t{across * across}, std::size_t{across}, std::size_t{1}})
            smooth(values, stride);
        const float floor = 2e-5F * std::max(static_cast<float>(cv::sum(weights)[0]), 1.0F);
        float sum = 0.0F;
        for (float& value : values) sum += value += floor;
        for (float& value : values) value /= sum;
        return values;
    }

    /// [1, 2, 1] / 4 along the axis of this stride, its ends repeated.
    static void smooth(std::vector<float>& values, std::size_t stride) {
        const std::vector<float> former = values;
        for (std::size_t i = 0; i < values.size(); ++i) {
            const std::size_t index = i / stride % across;
            const float before = former[index == 0 ? i : i - stride];
            const float after = former[index == across - 1 ? i : i + stride];
            values[i] = 0.25F * before + 0.5F * former[i] + 0.25F * after;
        }
    }

    cv::Mat cells_;
};

/// Adds the log odds of the prior to those of the position. The weights of both are those that
/// agree best with hand-made masks (docs/studies/preparing-photos.md).
void add_probability(cv::Mat& odds, const HeadPrior& known) {
    // Both sources contain the position, so neither has its full weight.
    const float share_of_position = known.is_sharp ? 0.5F : 0.25F;
    const float share_of_known = known.is_sharp ? 1.0F : 0.35F;
    const Tensor small = resize_image(known.probability, side, side);
    const std::span<const float> probability = small.values<float>();
    std::transform(odds.begin<float>(), odds.end<float>(), probability.begin(), odds.begin<float>(),
                   [&](float position, float value) {
                       const double clamped = std::clamp(static_cast<double>(value), 0.01, 0.99);
                       return share_of_position * position + share_of_known * log_odds(clamped);
                   });
}

/// Log odds that a pixel belongs to the head, regardless of its colour.
cv::Mat prior_log_odds(const HeadPosition& head, const cv::Mat& face, const cv::Mat& neck,
                       const HeadPrior& known) {
    cv::Mat odds = log_odds_of_position(head);
    if (known.probability.defined()) add_probability(odds, known);
    if (known.is_sharp) {
        cv::add(odds, cv::Scalar(3.0), odds, face);
        cv::subtract(odds, cv::Scalar(2.0), odds, neck);
    } else {
        constexpr double certain = 20.0;
        odds.setTo(certain, face);
        odds.setTo(-certain, neck);
    }
    return odds;
}

/// Probability that each pixel belongs to the head, from the prior and from the colours of the
/// image itself.
cv::Mat posterior(const cv::Mat& image, const cv::Mat& prior, const cv::Mat& face,
                  const cv::Mat& neck) {
    constexpr int rounds = 3;
    constexpr float trust_in_colors = 0.6F;
    // Skin that is known by its position must not outweigh the colours of hair, nor the neck those
    // of the background.
    cv::Mat weight_of_head = cv::Mat::ones(side, side, CV_32F);
    cv::Mat weight_of_rest = cv::Mat::ones(side, side, CV_32F);
    weight_of_head.setTo(0.25, face);
    weight_of_rest.setTo(0.3, neck);
    const ColorCells colors(image);
    cv::Mat odds = prior.clone();
    cv::Mat probability(side, side, CV_32F);
    for (int round = 0; round <= rounds; ++round) {
        std::transform(
            odds.begin<float>(), odds.end<float>(), probability.begin<float>(),
            [](float value) { return static_cast<float>(logistic(static_cast<double>(value))); });
        const cv::Mat of_head = probability.mul(weight_of_head);
        const cv::Mat of_rest = (1.0F - probability).mul(weight_of_rest);
        odds = prior + trust_in_colors * colors.log_ratio(of_head, of_rest);
    }
    return probability;
}

Tensor mask_of(const cv::Mat& labels) {
    Tensor mask({labels.rows, labels.cols, 1});
    std::transform(labels.begin<unsigned char>(), labels.end<unsigned char>(),
                   mask.mutable_values<float>().begin(), [](unsigned char label) {
                       return label == cv::GC_FGD || label == cv::GC_PR_FGD ? 1.0F : 0.0F;
                   });
    return mask;
}

Tensor cut(const cv::Mat& image, const cv::Mat& probability) {
    constexpr double sure = 0.9;
    cv::Mat labels(side, side, CV_8U, cv::Scalar(cv::GC_PR_BGD));
    labels.setTo(cv::GC_PR_FGD, probability > 0.5);
    labels.setTo(cv::GC_FGD, probability > sure);
    labels.setTo(cv::GC_BGD, probability < 1.0 - sure);
    // GrabCut's colour models need pixels of both kinds.
    const int head_pixels = cv::countNonZero(probability > 0.5);
    constexpr int fewest = 16;
    if (head_pixels < fewest || head_pixels > side * side - fewest) return mask_of(labels);
    cv::setRNGSeed(0);
    cv::Mat background, foreground;
    cv::grabCut(image, labels, {}, background, foreground, 1, cv::GC_INIT_WITH_MASK);
    return mask_of(labels);
}

}  // namespace

Tensor grab_cut_head_mask(const Tensor& crop, const Landmarks& landmarks, const HeadPrior& prior) {
    if (crop.rank() != 3 || crop.size() == 0 || crop.shape(0) != crop.shape(1) ||
        crop.shape(2) != 3)
        fail<ShapeError>("[grab_cut] a crop is (side, side, 3); got ", crop.shape());
    if (prior.probability.defined() &&
        !(prior.probability.shape() == Shape{crop.shape(0), crop.shape(1), 1}))
        fail<ShapeError>("[grab_cut] a probability for each pixel of ", crop.shape(),
                         " is wanted; got ", prior.probability.shape());
    const HeadPosition head =
        head_position(scaled_landmarks(landmarks, side / static_cast<double>(crop.shape(0))));
    if (!(head.jaw_width > 0.0 && head.eyes_to_chin > 0.0))
        fail<ValueError>("[grab_cut] the landmarks are not those of an upright face");
    const cv::Mat image = bytes_of(resize_image(crop, side, side));
    const cv::Mat face = face_of(head);
    cv::Mat neck = neck_of(head);
    neck.setTo(0, face);
    const cv::Mat odds = prior_log_odds(head, face, neck, prior);
    const Tensor mask = clean_head_mask(cut(image, posterior(image, odds, face, neck)));
    const auto output_side = static_cast<int>(crop.shape(0));
    return clean_head_mask(resize_image(mask, output_side, output_side));
}

}  // namespace stymo
