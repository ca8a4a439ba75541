#include "fit/photo/photo_look.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace stymo {
namespace {

using Point = Eigen::Vector2d;
using Color = Eigen::Vector3d;

double quantile(std::vector<double> values, double share) {
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

struct Pixels {
    const Tensor& image;
    const Tensor& known;

    [[nodiscard]] bool is_known(std::int64_t pixel) const {
        return !known.defined() || known.values<float>()[static_cast<std::size_t>(pixel)] != 0.0F;
    }
    [[nodiscard]] Color color(std::int64_t pixel) const {
        return Eigen::Map<const Eigen::Vector3f>(image.values<float>().data() + 3 * pixel)
            .cast<double>();
    }
    [[nodiscard]] double grey(std::int64_t pixel) const { return color(pixel).mean(); }
};

/// The pixels around a point; nothing if one is unknown or outside the image.
std::vector<std::int64_t> disc(const Pixels& pixels, const Point& center, double radius) {
    const std::int64_t side = pixels.image.shape(0);
    std::vector<std::int64_t> result;
    for (auto y = std::floor(center.y() - radius); y <= center.y() + radius; ++y)
        for (auto x = std::floor(center.x() - radius); x <= center.x() + radius; ++x) {
            if ((Point(x, y) - center).norm() > radius) continue;
            if (std::min(x, y) < 0.0 || std::max(x, y) >= static_cast<double>(side)) return {};
            const std::int64_t pixel =
                static_cast<std::int64_t>(y) * side + static_cast<std::int64_t>(x);
            if (!pixels.is_known(pixel)) return {};
            result.push_back(pixel);
        }
    return result;
}

double brightness_of(const Pixels& pixels) {
    std::vector<double> values;
    for (std::int64_t i = 0; i < pixels.image.size() / 3; ++i)
        if (pixels.is_known(i)) values.push_back(pixels.grey(i));
    constexpr double nearly_all = 0.99;
    return values.empty() ? 1.0 : quantile(std::move(values), nearly_all);
}

/// Sets noise and share of clipped pixels of a disc.
void measure_light(const Pixels& pixels, const Point& center, double radius, PhotoLook& look) {
    const std::int64_t side = pixels.image.shape(0);
    std::vector<double> residuals, greys;
    double clipped = 0.0;
    for (std::int64_t i = 0; i < side * side; ++i) {
        const std::int64_t x = i % side, y = i / side;
        const Point pixel(static_cast<double>(x), static_cast<double>(y));
        if (std::min(x, y) < 1 || std::max(x, y) > side - 2 || !pixels.is_known(i) ||
            !((pixel - center).norm() < radius))
            continue;
        const auto row = [&](std::int64_t at) {
            return pixels.grey(at - 1) - 2.0 * pixels.grey(at) + pixels.grey(at + 1);
        };
        residuals.push_back(std::abs(row(i - side) - 2.0 * row(i) + row(i + side)));
        greys.push_back(pixels.grey(i));
        const double highest = pixels.color(i).maxCoeff();
        if (highest > 0.99 || highest < 0.01) ++clipped;
    }
    if (greys.empty()) return;
    look.clipped = clipped / static_cast<double>(greys.size());
    constexpr double deviation_of_median = 0.6745, gain = 6.0, darkest = 0.004;
    look.noise = quantile(std::move(residuals), 0.5) / (deviation_of_median * gain) /
                 std::max(darkest, quantile(std::move(greys), 0.5));
}

}  // namespace

PhotoLook look_of(const Tensor& image, const Tensor& mask, const Landmarks& landmarks,
                  const Tensor& known, const FaceCovers& covers) {
    const Pixels pixels{image, known};
    const Point left = mean_landmark(landmarks, 36, 41), right = mean_landmark(landmarks, 42, 47);
    const double eye_distance = (right - left).norm();
    const auto around = [&](const Point& point) {
        constexpr double radius_in_eye_distances = 0.12;
        return disc(pixels, point, radius_in_eye_distances * eye_distance);
    };
    const auto in_mask = [&](const Point& point) {
        std::vector<double> values;
        for (const std::int64_t i : around(point))
            values.push_back(mask.values<float>()[static_cast<std::size_t>(i)]);
        return values.empty() ? 1.0 : quantile(std::move(values), 0.5);
    };
    const Point mouth = mean_landmark(landmarks, 48, 67);
    PhotoLook look;
    if (!around(mouth).empty()) look.covers.mouth = covers.mouth;
    if (!around(left).empty() && !around(right).empty()) look.covers.eyes = covers.eyes;
    look.mouth_in_mask = in_mask(mouth);
    // The farther eye of a profile lies at or behind the outline.
    const double to_left = (left - landmarks[27]).norm(), to_right = (right - landmarks[27]).norm();
    look.eyes_in_mask = std::min(to_right < 2.0 * to_left ? in_mask(left) : 1.0,
                                 to_left < 2.0 * to_right ? in_mask(right) : 1.0);
    look.brightness = brightness_of(pixels);
    measure_light(pixels, landmarks[30], 0.9 * eye_distance, look);
    return look;
}

}  // namespace stymo
