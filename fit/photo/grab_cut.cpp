#include "fit/photo/grab_cut.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/image_bytes.h"
#include "fit/photo/head_mask.h"

namespace stymo {
namespace {

/// GrabCut's cost grows faster than the pixels, its quality does not: 128 and 256 pixels gave the same agreement with hand-made
/// masks.
constexpr int working_side = 128;
constexpr int rounds = 2;

/// What the landmarks tell of a head's place in an upright crop, in pixels of the working copy.
struct HeadPlace {
    double center_x;
    double eyes_y;
    double brows_y;
    double jaw_width;
    double eyes_to_chin;
};

HeadPlace place_of(const Landmarks& landmarks) {
    const PicturePoint left_eye = mean_landmark(landmarks, 36, 41);
    const PicturePoint right_eye = mean_landmark(landmarks, 42, 47);
    const double eyes_x = (left_eye[0] + right_eye[0]) / 2;
    const double eyes_y = (left_eye[1] + right_eye[1]) / 2;
    return {(landmarks[0][0] + landmarks[16][0] + 2 * eyes_x) / 4, eyes_y, mean_landmark(landmarks, 17, 26)[1],
            landmarks[16][0] - landmarks[0][0], landmarks[8][1] - eyes_y};
}

cv::Point pixel_at(double x, double y) {
    return {cvRound(x - 0.5), cvRound(y - 0.5)};
}

void fill(cv::Mat& labels, const std::vector<cv::Point>& polygon, int label) {
    cv::fillPoly(labels, std::vector<std::vector<cv::Point>>{polygon}, cv::Scalar(label));
}

/// Labels by two ellipses around the skull: surely head within the one, perhaps within the other, surely not far from either.
cv::Mat labels_of_skull(const HeadPlace& head) {
    constexpr double surely = 0.71;
    constexpr double surely_not = 1.63;
    const double half_width = 0.67 * head.jaw_width;
    const double half_height = 1.18 * head.eyes_to_chin;
    cv::Mat labels(working_side, working_side, CV_8U);
    for (int row = 0; row < working_side; ++row)
        for (int column = 0; column < working_side; ++column) {
            const double across = (column + 0.5 - head.center_x) / half_width;
            const auto distance = [&](double drop) {
                return std::hypot(across, (row + 0.5 - head.eyes_y - drop * head.eyes_to_chin) / half_height);
            };
            int label = distance(0.27) < 1.0 ? cv::GC_PR_FGD : cv::GC_PR_BGD;
            if (distance(0.27) > surely_not) label = cv::GC_BGD;
            if (distance(-0.10) < surely) label = cv::GC_FGD;
            labels.at<unsigned char>(row, column) = static_cast<unsigned char>(label);
        }
    return labels;
}

/// The neck has the face's colour, so that only its place tells it from the head.
void exclude_neck(cv::Mat& labels, const Landmarks& landmarks, const HeadPlace& head) {
    std::vector<cv::Point> neck;
    for (std::size_t i = 4; i <= 12; ++i) neck.push_back(pixel_at(landmarks[i][0], landmarks[i][1] + 0.05 * head.eyes_to_chin));
    neck.push_back(pixel_at(head.center_x + 0.2 * head.jaw_width, working_side + 1.0));
    neck.push_back(pixel_at(head.center_x - 0.2 * head.jaw_width, working_side + 1.0));
    fill(labels, neck, cv::GC_BGD);
}

void include_face(cv::Mat& labels, const Landmarks& landmarks, const HeadPlace& head) {
    std::vector<cv::Point> points;
    for (const PicturePoint& point : landmarks) points.push_back(pixel_at(point[0], point[1]));
    std::vector<cv::Point> hull;
    cv::convexHull(points, hull);
    fill(labels, hull, cv::GC_FGD);
    const cv::Size forehead(cvRound(0.38 * head.jaw_width), cvRound(0.6 * head.eyes_to_chin));
    cv::ellipse(labels, pixel_at(head.center_x, head.brows_y), forehead, 0, 180, 360, cv::Scalar(cv::GC_FGD), cv::FILLED);
}

cv::Mat bytes_of(const Tensor& picture) {
    const std::vector<std::uint8_t> bytes = image_bytes(picture);
    cv::Mat result(static_cast<int>(picture.shape(0)), static_cast<int>(picture.shape(1)), CV_8UC3);
    std::copy(bytes.begin(), bytes.end(), result.data);
    return result;
}

Tensor cut(const Tensor& crop, cv::Mat labels) {
    // GrabCut seeds its colour models at random.
    cv::setRNGSeed(0);
    cv::Mat background, foreground;
    cv::grabCut(bytes_of(resize_image(crop, working_side, working_side)), labels, {}, background, foreground, rounds,
                cv::GC_INIT_WITH_MASK);
    Tensor mask({working_side, working_side, 1});
    std::transform(labels.begin<unsigned char>(), labels.end<unsigned char>(), mask.mutable_values<float>().begin(),
                   [](unsigned char label) { return label == cv::GC_FGD || label == cv::GC_PR_FGD ? 1.0F : 0.0F; });
    const auto rows = static_cast<int>(crop.shape(0));
    const auto columns = static_cast<int>(crop.shape(1));
    return clean_head_mask(resize_image(clean_head_mask(mask), rows, columns));
}

void require_square(const Tensor& crop) {
    if (crop.rank() != 3 || crop.size() == 0 || crop.shape(0) != crop.shape(1) || crop.shape(2) != 3)
        fail<ShapeError>("[grab_cut] a crop is (side, side, 3); got ", crop.shape());
}

}  // namespace

Tensor grab_cut_head_mask(const Tensor& crop, const Landmarks& landmarks) {
    require_square(crop);
    const Landmarks scaled = scaled_landmarks(landmarks, working_side / static_cast<double>(crop.shape(0)));
    const HeadPlace head = place_of(scaled);
    if (!(head.jaw_width > 0.0 && head.eyes_to_chin > 0.0))
        fail<ValueError>("[grab_cut] the landmarks are not those of an upright face");
    cv::Mat labels = labels_of_skull(head);
    exclude_neck(labels, scaled, head);
    include_face(labels, scaled, head);
    return cut(crop, std::move(labels));
}

}  // namespace stymo
