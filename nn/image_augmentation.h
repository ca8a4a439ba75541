#pragma once

#include <array>
#include <span>

#include "core/autograd/variable.h"
#include "core/rng.h"

/// Adaptive discriminator augmentation (Karras et al. 2020, "Training generative adversarial
/// networks with limited data": pixel blitting, geometric and colour transformations). Photos and
/// rendered images are transformed with the same distribution, so that the discriminator cannot
/// memorise a small set of photos.
namespace stymo {

/// The transformation of one image, as matrices. Points (x, y, 1) have coordinates in [-1, 1]
/// inside the image, y downwards. Colours (r, g, b, 1) are in [-1, 1].
struct ImageAugmentation {
    std::array<double, 6> source_from_target{1, 0, 0, 0, 1, 0};        ///< 2x3, row by row
    std::array<double, 12> color{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  ///< 3x4, row by row

    bool operator==(const ImageAugmentation&) const = default;
};

/// Draws each of the paper's transformations with this probability. With the same generator, a
/// higher probability only adds transformations to those of a lower one.
[[nodiscard]] ImageAugmentation drawn_augmentation(Rng rng, double probability);

/// Transforms each of images (B, S, S, 3) in [-1, 1] by its own augmentation, with bilinear
/// interpolation and black (-1) beyond the border. Without augmentations it returns the images
/// unchanged. Throws ShapeError for another number of augmentations or other extents.
[[nodiscard]] Variable augmented(const Variable& images,
                                 std::span<const ImageAugmentation> augmentations);

/// The augmentation probability, which adapts to how well the discriminator separates photos from
/// rendered images.
class AdaptiveProbability {
public:
    /// `target` is the target of the mean sign of the photos' logits; with 0 the probability stays
    /// 0. `images` is the number of photos in which the probability can rise from 0 to 1.
    AdaptiveProbability(double target, double images) : target_(target), images_(images) {}

    [[nodiscard]] bool adapts() const { return target_ > 0.0; }
    [[nodiscard]] double value() const { return value_; }
    void set(double value) { value_ = value; }
    /// Updates the probability after a step with this number of photos.
    void update(double mean_sign, double photos);

private:
    double target_;
    double images_;
    double value_ = 0.0;
};

}  // namespace stymo
