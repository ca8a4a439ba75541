#pragma once

#include <cstdint>

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// The square of a photo that FFHQ's recipe cuts out of it, in pixels.
struct Alignment {
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    /// From the centre to the middle of the right side.
    Eigen::Vector2d axis = Eigen::Vector2d::Zero();

    /// From the centre to the middle of the lower side.
    [[nodiscard]] Eigen::Vector2d down_axis() const { return {-axis.y(), axis.x()}; }
    /// The point of the photo at (u, v) of the square, each from -1 to 1, v downwards.
    [[nodiscard]] Eigen::Vector2d point(double u, double v) const {
        return center + u * axis + v * down_axis();
    }
    /// Side of the square in pixels of the photo.
    [[nodiscard]] double side() const { return 2.0 * axis.norm(); }
    /// Angle from the photo's x axis to the square's, in radians, positive when clockwise on the
    /// image.
    [[nodiscard]] double angle() const;
};

/// FFHQ's square (T. Karras et al., "A Style-Based Generator Architecture for Generative
/// Adversarial Networks", 2019): x from the line of the eyes and the line from eyes to mouth, twice
/// the distance of the eyes or 1.8 times that to the mouth, whichever is longer. Throws
/// NumericError for landmarks without extent.
[[nodiscard]] Alignment ffhq_alignment(const Landmarks& landmarks);

/// Whether a photo of this size is the square already, as the photos of FFHQ and CelebA-HQ are.
[[nodiscard]] bool is_aligned(const Alignment& alignment, std::int64_t width, std::int64_t height);

/// The square of the photo (height, width, channels) as an image of side x side pixels,
/// antialiased. Where the square leaves the photo, the photo is continued by reflection, which
/// fades into a blurred copy and then into its median colour.
[[nodiscard]] Tensor aligned_crop(const Tensor& photo, const Alignment& alignment,
                                  std::int64_t side);

/// Landmarks of the photo in the image of aligned_crop.
[[nodiscard]] Landmarks aligned_landmarks(const Landmarks& landmarks, const Alignment& alignment,
                                          std::int64_t side);

/// Share of the square's area outside the photo.
[[nodiscard]] double share_outside(const Alignment& alignment, std::int64_t width,
                                   std::int64_t height);

}  // namespace stymo
