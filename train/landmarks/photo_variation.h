#pragma once

#include <vector>

#include "core/rng.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// A training example for a landmark network: an image of its input size, and the points in
/// coordinates from -1 to 1.
struct LandmarkTarget {
    Tensor image;  ///< (side, side, 3)
    FacePoints points;
};

/// Standard deviations of the random change of a square around the points (normal, truncated at 2.5
/// deviations).
struct SquareJitter {
    double shift = 0.06;      ///< in units of half the square's side
    double log_scale = 0.10;  ///< in the logarithm of its side
    double angle_degrees = 9.0;
};

[[nodiscard]] FaceSquare jittered(FaceSquare square, const SquareJitter& jitter, Rng& rng);

/// A random variation of an example (data augmentation): moved, mirrored, in front of a part of one
/// of the backgrounds (height, width, 3) or of a drawn background, partly covered, with changed
/// colours, blur, noise and compression.
[[nodiscard]] LandmarkTarget varied(const LandmarkExample& example,
                                    const std::vector<Tensor>& backgrounds, std::int64_t side,
                                    Rng rng);

}  // namespace stymo
