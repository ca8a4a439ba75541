#include "fit/photo/photo_look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

namespace stymo {
namespace {

using Color = Eigen::Vector3d;

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
};

double quantile(std::vector<double> values, double share) {
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// Logarithms of colour and brightness of the median colour around a point; nothing if a pixel is
/// unknown or outside the image.
std::optional<Color> tone_at(const Pixels& pixels, const Eigen::Vector2d& center, double radius) {
    constexpr double brightness_weight = 0.3, darkest = 0.02;
    const std::int64_t side = pixels.image.shape(0);
    std::array<std::vector<double>, 3> channels;
    for (auto y = std::floor(center.y() - radius); y <= center.y() + radius; ++y)
        for (auto x = std::floor(center.x() - radius); x <= center.x() + radius; ++x) {
            if ((Eigen::Vector2d(x, y) - center).norm() > radius) continue;
            if (std::min(x, y) < 0.0 || std::max(x, y) >= static_cast<double>(side))
                return std::nullopt;
            const std::int64_t pixel =
                static_cast<std::int64_t>(y) * side + static_cast<std::int64_t>(x);
            if (!pixels.is_known(pixel)) return std::nullopt;
            const Color color = pixels.color(pixel);
            for (std::size_t c = 0; c < 3; ++c)
                channels[c].push_back(color[static_cast<Eigen::Index>(c)]);
        }
    if (channels[0].empty()) return std::nullopt;
    Color median;
    for (std::size_t c = 0; c < 3; ++c)
        median[static_cast<Eigen::Index>(c)] = std::max(darkest, quantile(channels[c], 0.5));
    return Color(std::log(median[0] / median[1]), std::log(median[2] / median[1]),
                 brightness_weight * std::log(median.mean()));
}

/// The smallest difference of any place from any reference; 0 if one is unknown.
template <std::size_t P, std::size_t R>
double difference(const std::array<std::optional<Color>, P>& places,
                  const std::array<std::optional<Color>, R>& references) {
    double least = 1e9;
    for (const auto& place : places)
        for (const auto& reference : references) {
            if (!place || !reference) return 0.0;
            least = std::min(least, (*place - *reference).norm());
        }
    return least;
}

double brightness_of(const Pixels& pixels) {
    std::vector<double> values;
    for (std::int64_t i = 0; i < pixels.image.size() / 3; ++i)
        if (pixels.is_known(i)) values.push_back(pixels.color(i).mean());
    constexpr double nearly_all = 0.99;
    return values.empty() ? 1.0 : quantile(std::move(values), nearly_all);
}

}  // namespace

PhotoLook look_of(const Tensor& image, const Landmarks& landmarks, const Tensor& known) {
    const Pixels pixels{image, known};
    const Eigen::Vector2d left = mean_landmark(landmarks, 36, 41),
                          right = mean_landmark(landmarks, 42, 47);
    constexpr double radius_in_eye_distances = 0.12;
    const double radius = radius_in_eye_distances * (right - left).norm();
    const auto tone = [&](const Eigen::Vector2d& point) { return tone_at(pixels, point, radius); };
    const auto below = [](const Eigen::Vector2d& eye, const Eigen::Vector2d& nostril) {
        return Eigen::Vector2d(eye + 0.15 * (nostril - eye));
    };
    const auto brows = tone(0.5 * (landmarks[21] + landmarks[22]));
    PhotoLook look;
    look.lower_face = difference<2, 1>(
        {tone(mean_landmark(landmarks, 48, 67)), tone(0.35 * landmarks[8] + 0.65 * landmarks[57])},
        {brows});
    look.eyes = difference<4, 2>({tone(left), tone(right), tone(below(left, landmarks[31])),
                                  tone(below(right, landmarks[35]))},
                                 {brows, tone(landmarks[30])});
    look.brightness = brightness_of(pixels);
    return look;
}

}  // namespace stymo
