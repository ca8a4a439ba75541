#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/autograd/variable.h"
#include "core/tensor.h"

namespace stymo {

/// The 68 points of a face, in the order and the pixel coordinates of `fit/photo/landmarks.h`.
using FacePoints = std::array<Eigen::Vector2d, 68>;

/// The square of a photo that a landmark network sees, in pixels of the photo. It may be turned and
/// may reach beyond the photo.
struct FaceSquare {
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    /// Vector from the centre to the middle of the right side.
    Eigen::Vector2d axis = Eigen::Vector2d::UnitX();

    /// The point of the photo at the coordinates (u, v) of the square, each in [-1, 1], v
    /// downwards.
    [[nodiscard]] Eigen::Vector2d point(const Eigen::Vector2d& at) const {
        return center + at.x() * axis + at.y() * Eigen::Vector2d(-axis.y(), axis.x());
    }
    /// Inverse of `point`.
    [[nodiscard]] Eigen::Vector2d coordinates(const Eigen::Vector2d& point) const;
};

/// A square around all points with a margin, with its u axis along the line of the eyes. Throws
/// NumericError if both eyes are at the same point.
[[nodiscard]] FaceSquare square_around(const FacePoints& points);
/// A square of about the same extent as `square_around`, from the box of dlib's frontal face
/// detector.
[[nodiscard]] FaceSquare square_of_box(double left, double top, double width, double height);
/// The line of a photo about which a face is nearly symmetric.
struct Midline {
    Eigen::Vector2d point = Eigen::Vector2d::Zero();
    Eigen::Vector2d normal = Eigen::Vector2d::UnitX();

    [[nodiscard]] Eigen::Vector2d mirrored(const Eigen::Vector2d& at) const {
        return at - 2.0 * (at - point).dot(normal) * normal;
    }
};
/// The midline through nose and lips.
[[nodiscard]] Midline midline_of(const FacePoints& points);

/// Resamples the square of a photo (height, width, C) to an image (side, side, C) with
/// antialiasing. Pixels outside the photo show what the photo has at their mirror image about the
/// midline, if there is one and the photo has that pixel; else they repeat its border. Throws
/// ShapeError for a photo of another rank.
[[nodiscard]] Tensor image_in_square(const Tensor& photo, const FaceSquare& square,
                                     std::int64_t side,
                                     const std::optional<Midline>& midline = std::nullopt);
/// The index of the point that point k becomes in the mirror image.
[[nodiscard]] std::size_t mirrored_point(std::size_t k);

/// Images (B, H, W, C) with zero mean and almost unit deviation over each image, so that a network
/// does not depend on brightness and contrast.
[[nodiscard]] Variable unit_contrast(const Variable& images);

}  // namespace stymo
