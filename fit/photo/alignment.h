#pragma once

#include <cstdint>

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// The square that FFHQ's alignment cuts out of a photo, in pixels of the photo.
struct Alignment {
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    /// Vector from the centre to the middle of the right side.
    Eigen::Vector2d axis = Eigen::Vector2d::Zero();

    /// Vector from the centre to the middle of the lower side.
    [[nodiscard]] Eigen::Vector2d down_axis() const { return {-axis.y(), axis.x()}; }
    /// The point of the photo at the coordinates (u, v) of the square, each in [-1, 1], v
    /// downwards.
    [[nodiscard]] Eigen::Vector2d point(double u, double v) const {
        return center + u * axis + v * down_axis();
    }
    /// Side of the square in pixels of the photo.
    [[nodiscard]] double side() const { return 2.0 * axis.norm(); }
    /// Angle from the photo's x axis to the square's, in radians, clockwise in the image.
    [[nodiscard]] double angle() const;
};

/// FFHQ's square (T. Karras et al., "A Style-Based Generator Architecture for Generative
/// Adversarial Networks", 2019): the x axis comes from the line of the eyes and the line from eyes
/// to mouth. Half the side is twice the distance of the eyes or 1.8 times the distance from eyes to
/// mouth, whichever is longer. Throws NumericError for landmarks without extent.
[[nodiscard]] Alignment ffhq_alignment(const Landmarks& landmarks);

/// Whether a photo of this size is already aligned, like the photos of FFHQ and CelebA-HQ.
[[nodiscard]] bool is_aligned(const Alignment& alignment, std::int64_t width, std::int64_t height);

/// Resamples the square of the photo (height, width, channels) to (side, side, channels) with
/// antialiasing, from `samples_of_a_pixel` samples across each pixel. Outside the photo it is
/// continued by reflection, which fades into a blurred copy and then into its median colour.
[[nodiscard]] Tensor aligned_crop(const Tensor& photo, const Alignment& alignment,
                                  std::int64_t side, std::int64_t samples_of_a_pixel = 4);

/// The known pixels of aligned_crop, (side, side, 1), see nn/known_pixels.h: those that
/// lie, with a pixel of the crop around them, within the photo and on known pixels of
/// `photo_known` (height, width, 1), if it is defined. Undefined if all are known.
[[nodiscard]] Tensor known_crop(const Alignment& alignment, std::int64_t side, std::int64_t height,
                                std::int64_t width, const Tensor& photo_known = {});

/// The landmarks of the photo in pixels of aligned_crop.
[[nodiscard]] Landmarks aligned_landmarks(const Landmarks& landmarks, const Alignment& alignment,
                                          std::int64_t side);

/// Share of the square's area outside the photo.
[[nodiscard]] double share_outside(const Alignment& alignment, std::int64_t width,
                                   std::int64_t height);

}  // namespace stymo
