#pragma once

#include <array>
#include <span>

#include "core/autograd/variable.h"
#include "core/rng.h"

/// What a discriminator sees of photos and rendered images when photos are few: both changed at
/// random in the same way, so that it cannot learn the photos by heart (Karras et al. 2020,
/// "Training generative adversarial networks with limited data": pixel blitting, geometric and
/// colour transformations).
namespace stymo {

/// A change of one image. Points (x, y, 1) have coordinates in [-1, 1] inside of the image, y
/// downwards; colours (r, g, b, 1) are in [-1, 1].
struct ImageAugmentation {
    std::array<double, 6> source_from_target{1, 0, 0, 0, 1, 0};        ///< of points, row by row
    std::array<double, 12> color{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  ///< row by row

    bool operator==(const ImageAugmentation&) const = default;
};

/// Each of the paper's transformations takes place with this probability. A higher one adds
/// transformations to those that the same generator gives at a lower one.
[[nodiscard]] ImageAugmentation drawn_augmentation(Rng rng, double probability);

/// images (B, S, S, 3) in [-1, 1], each changed by its own augmentation: bilinear, black (-1)
/// beyond the image's border. No augmentations at all: the images themselves. Throws ShapeError for
/// another number of augmentations or other extents.
[[nodiscard]] Variable augmented(const Variable& images,
                                 std::span<const ImageAugmentation> augmentations);

/// The probability that keeps a discriminator from telling photos apart too well.
class AdaptiveProbability {
public:
    /// `target`: of the mean sign of the logits of photos; 0: the probability stays 0. `images`: so
    /// many take it from 0 to 1.
    AdaptiveProbability(double target, double images) : target_(target), images_(images) {}

    [[nodiscard]] bool adapts() const { return target_ > 0.0; }
    [[nodiscard]] double value() const { return value_; }
    void set(double value) { value_ = value; }
    /// After a step with so many photos.
    void update(double mean_sign, double photos);

private:
    double target_;
    double images_;
    double value_ = 0.0;
};

}  // namespace stymo
