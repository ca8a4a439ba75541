#include "nn/image_augmentation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {

namespace {

constexpr double pi = std::numbers::pi;
constexpr double ln2 = std::numbers::ln2;

Eigen::Matrix3d moved(double x, double y) {
    return Eigen::Matrix3d{{1, 0, x}, {0, 1, y}, {0, 0, 1}};
}

Eigen::Matrix3d scaled(double x, double y) {
    return Eigen::Matrix3d{{x, 0, 0}, {0, y, 0}, {0, 0, 1}};
}

Eigen::Matrix3d turned(double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return Eigen::Matrix3d{{c, -s, 0}, {s, c, 0}, {0, 0, 1}};
}

/// Random parameters of transformations, each of which is applied with a probability.
class Draws {
public:
    Draws(Rng rng, double probability) : rng_(rng), probability_(probability) {}

    /// Sets the probability of the following draws.
    void set_probability(double probability) { probability_ = probability; }
    /// Returns `without` if the transformation is not applied.
    double uniform(double low, double high, double without) {
        return chosen(rng_.uniform(low, high), without);
    }
    double whole(double bound, double without) {
        return chosen(std::floor(bound * rng_.uniform()), without);
    }
    double normal(double deviation) { return chosen(deviation * rng_.normal(), 0.0); }
    /// A factor whose logarithm has this standard deviation.
    double factor(double deviation) { return std::exp(normal(deviation)); }

private:
    double chosen(double value, double without) {
        return rng_.uniform() < probability_ ? value : without;
    }

    Rng rng_;
    double probability_;
};

Eigen::Matrix3d drawn_geometry(Draws& draw, double probability) {
    Eigen::Matrix3d map = scaled(draw.whole(2, 0) == 1 ? -1 : 1, 1);
    map *= turned(pi / 2 * draw.whole(4, 0));
    // The order of draws in one expression would be the compiler's choice.
    const double right = draw.uniform(-0.25, 0.25, 0), down = draw.uniform(-0.25, 0.25, 0);
    map *= moved(right, down);
    const double size = draw.factor(0.2 * ln2);
    map *= scaled(size, size);
    // There are rotations before and after the stretching. That at least one of them is applied has
    // the same probability as the other transformations.
    draw.set_probability(1.0 - std::sqrt(1.0 - probability));
    const double before = draw.uniform(-pi, pi, 0), after = draw.uniform(-pi, pi, 0);
    draw.set_probability(probability);
    const double stretch = draw.factor(0.2 * ln2);
    map *= turned(before) * scaled(stretch, 1 / stretch) * turned(after);
    const double last_right = draw.normal(0.25), last_down = draw.normal(0.25);
    return map * moved(last_right, last_down);
}

/// Brightness, contrast, flipped luma, hue and saturation, in this order.
Eigen::Matrix<double, 3, 4> drawn_color(Draws& draw) {
    const Eigen::Vector3d gray = Eigen::Vector3d::Constant(1.0 / std::sqrt(3.0));
    const Eigen::Matrix3d luma = gray * gray.transpose(), all = Eigen::Matrix3d::Identity();
    // The colours of the paper are in [-1, 1] too.
    const double brightness = draw.normal(0.2), contrast = draw.factor(0.5 * ln2);
    const bool flips = draw.whole(2, 0) == 1;
    const double hue = draw.uniform(-pi, pi, 0), saturation = draw.factor(ln2);
    Eigen::Matrix3d map = contrast * all;
    if (flips) map = (all - 2.0 * luma) * map;
    map = Eigen::AngleAxisd(hue, gray).toRotationMatrix() * map;
    map = (luma + (all - luma) * saturation) * map;
    Eigen::Matrix<double, 3, 4> result;
    result << map, map * Eigen::Vector3d::Constant(brightness);
    return result;
}

/// One of the four source pixels of the bilinear interpolation, for all target pixels.
struct Tap {
    RowIndices rows;
    std::vector<double> weights;  ///< 0 beyond the border
};

std::array<Tap, 4> taps_of(std::span<const ImageAugmentation> augmentations, std::int64_t side) {
    std::array<Tap, 4> taps;
    const double half = 0.5 * static_cast<double>(side);
    for (std::size_t image = 0; image < augmentations.size(); ++image) {
        const auto& m = augmentations[image].source_from_target;
        for (std::int64_t pixel = 0; pixel < side * side; ++pixel) {
            const double x = (static_cast<double>(pixel % side) + 0.5) / half - 1.0,
                         y = (static_cast<double>(pixel / side) + 0.5) / half - 1.0;
            const double column = (m[0] * x + m[1] * y + m[2] + 1.0) * half - 0.5,
                         row = (m[3] * x + m[4] * y + m[5] + 1.0) * half - 0.5;
            for (int k = 0; k < 4; ++k) {
                const double at_row = std::floor(row) + k / 2,
                             at_column = std::floor(column) + k % 2;
                const bool inside = at_row >= 0.0 && at_column >= 0.0 &&
                                    at_row < static_cast<double>(side) &&
                                    at_column < static_cast<double>(side);
                Tap& tap = taps[static_cast<std::size_t>(k)];
                tap.rows.push_back(inside ? (static_cast<std::int64_t>(image) * side +
                                             static_cast<std::int64_t>(at_row)) *
                                                    side +
                                                static_cast<std::int64_t>(at_column)
                                          : 0);
                tap.weights.push_back(inside ? (1.0 - std::abs(row - at_row)) *
                                                   (1.0 - std::abs(column - at_column))
                                             : 0.0);
            }
        }
    }
    return taps;
}

Variable resampled(const Variable& images, std::span<const ImageAugmentation> augmentations) {
    const std::int64_t side = images.shape(1), pixels = images.shape(0) * side * side;
    // Black is zero, so that nothing needs to be added beyond the border.
    const Variable light = reshape(images + 1.0, {pixels, 3});
    Variable sum;
    for (Tap& tap : taps_of(augmentations, side)) {
        const Tensor weights =
            Tensor::from({pixels, 1}, std::span<const double>(tap.weights)).to(images.dtype());
        const Variable part = gather_rows(light, std::move(tap.rows)) * weights;
        sum = sum.defined() ? sum + part : part;
    }
    return reshape(sum - 1.0, images.shape());
}

Variable recolored(const Variable& images, std::span<const ImageAugmentation> augmentations) {
    const std::int64_t count = images.shape(0);
    std::vector<double> matrices, offsets;
    for (const ImageAugmentation& one : augmentations) {
        for (std::size_t row = 0; row < 3; ++row) {
            matrices.insert(matrices.end(), &one.color[4 * row], &one.color[4 * row] + 3);
            offsets.push_back(one.color[4 * row + 3]);
        }
    }
    const auto constant = [&](const Shape& shape, const std::vector<double>& values) {
        return Tensor::from(shape, std::span<const double>(values)).to(images.dtype());
    };
    const Variable colors = reshape(images, {count, images.shape(1) * images.shape(2), 3});
    return reshape(matmul(colors, constant({count, 3, 3}, matrices), {.transpose_b = true}) +
                       constant({count, 1, 3}, offsets),
                   images.shape());
}

}  // namespace

ImageAugmentation drawn_augmentation(Rng rng, double probability) {
    Draws draw(rng, probability);
    const Eigen::Matrix3d geometry = drawn_geometry(draw, probability);
    const Eigen::Matrix<double, 3, 4> color = drawn_color(draw);
    ImageAugmentation result;
    for (Eigen::Index i = 0; i < 6; ++i)
        result.source_from_target[static_cast<std::size_t>(i)] = geometry(i / 3, i % 3);
    for (Eigen::Index i = 0; i < 12; ++i)
        result.color[static_cast<std::size_t>(i)] = color(i / 4, i % 4);
    return result;
}

Variable augmented(const Variable& images, std::span<const ImageAugmentation> augmentations) {
    if (augmentations.empty()) return images;
    if (images.rank() != 4 || images.shape(1) != images.shape(2) || images.shape(3) != 3 ||
        images.shape(0) != std::ssize(augmentations))
        fail<ShapeError>("augmented: expected as many images (B, S, S, 3) as augmentations, ",
                         augmentations.size(), ", got ", images.shape());
    return recolored(resampled(images, augmentations), augmentations);
}

void AdaptiveProbability::update(double mean_sign, double photos) {
    if (!adapts()) return;
    value_ = std::clamp(value_ + (mean_sign > target_ ? photos : -photos) / images_, 0.0, 1.0);
}

}  // namespace stymo
