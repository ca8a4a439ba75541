#include "train/landmarks/photo_variation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/io/image.h"
#include "core/io/jpeg.h"
#include "train/landmarks/random.h"

namespace stymo {
namespace {

[[nodiscard]] Eigen::Vector3d random_color(Rng& rng) {
    const Eigen::Vector3d color(rng.uniform(), rng.uniform(), rng.uniform());
    const double grey = rng.uniform();
    return grey * color.mean() * Eigen::Vector3d::Ones() + (1.0 - grey) * color;
}

/// A gradient of two colours with waves.
[[nodiscard]] Tensor drawn_background(std::int64_t side, Rng& rng) {
    const Eigen::Vector3d first = random_color(rng), second = random_color(rng);
    const Eigen::Vector2d direction(rng.normal(), rng.normal());
    const Eigen::Vector2d wave(0.2 * rng.normal(), 0.2 * rng.normal());
    const double height = chance(rng, 0.5) ? between(rng, 0.0, 0.3) : 0.0;
    Tensor image({side, side, 3});
    auto value = image.mutable_values<float>().begin();
    for (std::int64_t row = 0; row < side; ++row)
        for (std::int64_t column = 0; column < side; ++column) {
            const Eigen::Vector2d at(static_cast<double>(column), static_cast<double>(row));
            const double t = std::clamp(0.5 + direction.dot(at) / static_cast<double>(side) - 0.5 +
                                            height * std::sin(wave.dot(at)),
                                        0.0, 1.0);
            for (int k = 0; k < 3; ++k)
                *value++ = static_cast<float>(first[k] + t * (second[k] - first[k]));
        }
    return image;
}

[[nodiscard]] Tensor background(const std::vector<Tensor>& photos, std::int64_t side, Rng& rng) {
    if (photos.empty() || chance(rng, 0.35)) return drawn_background(side, rng);
    const Tensor& photo =
        photos[static_cast<std::size_t>(rng.below(static_cast<std::int64_t>(photos.size())))];
    const auto height = static_cast<double>(photo.shape(0));
    const auto width = static_cast<double>(photo.shape(1));
    const double half = between(rng, 0.1, 0.5) * std::min(height, width);
    return image_in_square(
        photo, {{between(rng, 0.0, width), between(rng, 0.0, height)}, {half, 0.0}}, side);
}

void put_in_front_of(Tensor& image, const Tensor& behind) {
    const auto source = image.values<float>();
    Tensor result = behind;
    const auto values = result.mutable_values<float>();
    for (std::size_t pixel = 0; pixel < source.size() / 4; ++pixel)
        for (std::size_t k = 0; k < 3; ++k)
            values[3 * pixel + k] =
                source[4 * pixel + k] + (1.0F - source[4 * pixel + 3]) * values[3 * pixel + k];
    image = std::move(result);
}

/// A box or an ellipse of one colour or of a background over a part of the image.
void cover_part(Tensor& image, const std::vector<Tensor>& backgrounds, Rng& rng) {
    const std::int64_t side = image.shape(0);
    const Tensor cover = background(backgrounds, side, rng);
    const Eigen::Vector2d center(rng.uniform(), rng.uniform());
    const Eigen::Vector2d radius(between(rng, 0.05, 0.22), between(rng, 0.05, 0.22));
    const bool ellipse = chance(rng, 0.5);
    const auto source = cover.values<float>();
    const auto values = image.mutable_values<float>();
    for (std::size_t pixel = 0; pixel < values.size() / 3; ++pixel) {
        const auto index = static_cast<std::int64_t>(pixel);
        const Eigen::Vector2d at(static_cast<double>(index % side) / static_cast<double>(side),
                                 static_cast<double>(index / side) / static_cast<double>(side));
        const Eigen::Vector2d offset = (at - center).cwiseQuotient(radius);
        if ((ellipse ? offset.norm() : offset.lpNorm<Eigen::Infinity>()) < 1.0)
            std::copy_n(source.begin() + static_cast<std::ptrdiff_t>(3 * pixel), 3,
                        values.begin() + static_cast<std::ptrdiff_t>(3 * pixel));
    }
}

void change_colors(Tensor& image, Rng& rng) {
    const double exposure = std::exp(0.1 + 0.22 * rng.normal());
    const double gamma = std::exp(0.2 * rng.normal());
    const double saturation = chance(rng, 0.15) ? 0.0 : between(rng, 0.4, 1.3);
    const Eigen::Vector3d tint(std::exp(0.06 * rng.normal()), 1.0, std::exp(0.08 * rng.normal()));
    const double contrast = between(rng, 0.7, 1.3), lift = 0.05 * rng.normal();
    const auto values = image.mutable_values<float>();
    for (std::size_t at = 0; at < values.size(); at += 3) {
        Eigen::Vector3d color;
        for (int k = 0; k < 3; ++k) {
            const double value =
                std::clamp(static_cast<double>(values[at + static_cast<std::size_t>(k)]), 0.0, 1.0);
            color[k] = std::pow(exposure * tint[k] * value, gamma);
        }
        const double grey = color.mean();
        for (int k = 0; k < 3; ++k) {
            const double value = grey + saturation * (color[k] - grey);
            values[at + static_cast<std::size_t>(k)] =
                static_cast<float>(std::clamp(0.5 + contrast * (value - 0.5) + lift, 0.0, 1.0));
        }
    }
}

void damage(Tensor& image, Rng& rng) {
    const std::int64_t side = image.shape(0);
    if (chance(rng, 0.45)) {
        const auto coarse = static_cast<int>(between(rng, 0.35, 0.95) * static_cast<double>(side));
        image = resize_image(resize_image(image, coarse, coarse), static_cast<int>(side),
                             static_cast<int>(side));
    }
    if (chance(rng, 0.5)) {
        const double deviation = between(rng, 0.0, 0.05);
        for (float& value : image.mutable_values<float>())
            value += static_cast<float>(deviation * rng.normal());
    }
    for (float& value : image.mutable_values<float>()) value = std::clamp(value, 0.0F, 1.0F);
    if (chance(rng, 0.4))
        image =
            image_from_jpeg(jpeg_bytes(image, 25 + static_cast<int>(rng.below(70))), side * side);
}

}  // namespace

FaceSquare jittered(FaceSquare square, const SquareJitter& jitter, Rng& rng) {
    const Eigen::Vector2d shift(limited_normal(rng, jitter.shift, 2.5 * jitter.shift),
                                limited_normal(rng, jitter.shift, 2.5 * jitter.shift));
    const double scale = std::exp(limited_normal(rng, jitter.log_scale, 2.5 * jitter.log_scale));
    const double angle =
        radians_from_degrees(limited_normal(rng, jitter.angle_degrees, 2.5 * jitter.angle_degrees));
    square.center = square.point(shift);
    square.axis = scale * (Eigen::Rotation2Dd(angle) * square.axis);
    return square;
}

LandmarkTarget varied(const LandmarkExample& example, const std::vector<Tensor>& backgrounds,
                      std::int64_t side, Rng rng) {
    const FaceSquare square = jittered(square_around(example.points), {}, rng);
    LandmarkTarget target{image_in_square(example.image, square, side), {}};
    for (std::size_t k = 0; k < target.points.size(); ++k)
        target.points[k] = square.coordinates(example.points[k]);
    if (target.image.shape(2) == 4)
        put_in_front_of(target.image, background(backgrounds, side, rng));
    if (chance(rng, 0.5)) {
        target.image = mirror_image(target.image);
        target.points = mirrored_points(target.points, 0.0);
    }
    if (chance(rng, 0.2)) cover_part(target.image, backgrounds, rng);
    change_colors(target.image, rng);
    damage(target.image, rng);
    return target;
}

}  // namespace stymo
