#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "render/camera.h"

namespace stymo {

/// The 68 points of a face in dlib's order, each part from the image's left: jaw 0-16, brows 17-21
/// and 22-26, nose 27-35, eyes 36-41 and 42-47, lips 48-67. x to the right and y down, in pixels;
/// the centre of the first pixel is (0.5, 0.5). A new object is not initialised.
using Landmarks = std::array<Eigen::Vector2d, 68>;

/// The mean of the points first to last, inclusive.
[[nodiscard]] Eigen::Vector2d mean_landmark(const Landmarks& landmarks, std::size_t first,
                                            std::size_t last);
/// Distance between the centres of the two eyes.
[[nodiscard]] double inter_ocular_distance(const Landmarks& landmarks);
/// The landmarks in the same image scaled by `factor`.
[[nodiscard]] Landmarks scaled_landmarks(Landmarks landmarks, double factor);
/// Where a camera sees the mean of the built-in head, in an image of this side.
[[nodiscard]] Landmarks mean_face_landmarks(const Camera& camera, std::int64_t side);

}  // namespace stymo
