#pragma once

#include <cstdint>

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// The square of a photo that FFHQ's recipe cuts out of it, in pixels: its centre c and the half axis x, which goes from the
/// centre to the middle of the right side; y = (-x_y, x_x) goes to the middle of the lower side.
struct Alignment {
    double center_x = 0.0;
    double center_y = 0.0;
    double axis_x = 0.0;
    double axis_y = 0.0;

    /// Side of the square in pixels of the photo.
    [[nodiscard]] double side() const;
    /// Angle from the photo's x axis to the square's, in radians, positive when clockwise on the picture.
    [[nodiscard]] double angle() const;
};

/// FFHQ's square (T. Karras et al., "A Style-Based Generator Architecture for Generative Adversarial Networks", 2019): x from the
/// line of the eyes and the line from eyes to mouth, twice the distance of the eyes or 1.8 times that to the mouth, whichever is
/// longer. Throws NumericError for landmarks without extent.
[[nodiscard]] Alignment ffhq_alignment(const Landmarks& landmarks);

/// Whether a photo of this size is the square already, as the photos of FFHQ and CelebA-HQ are.
[[nodiscard]] bool is_aligned(const Alignment& alignment, std::int64_t width, std::int64_t height);

/// The square of the photo (height, width, channels) as a picture of side x side pixels, antialiased. Where the square leaves the
/// photo, the photo goes on mirrored, and there it fades into a blurred copy and then into its median colour.
[[nodiscard]] Tensor aligned_crop(const Tensor& photo, const Alignment& alignment, std::int64_t side);

/// Where landmarks of the photo lie in aligned_crop's picture.
[[nodiscard]] Landmarks aligned_landmarks(const Landmarks& landmarks, const Alignment& alignment, std::int64_t side);

/// Share of the square's area that lies outside of the photo.
[[nodiscard]] double share_outside(const Alignment& alignment, std::int64_t width, std::int64_t height);

}  // namespace stymo
