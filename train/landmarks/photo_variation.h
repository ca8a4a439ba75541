#pragma once

#include <vector>

#include "core/rng.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// What a landmark network learns from: an image of its input size, and the points in it from -1 to
/// 1.
struct LandmarkTarget {
    Tensor image;  ///< (side, side, 3)
    FacePoints points;
};

/// How far a square is moved from the one around the points (normal, cut off at 2.5 deviations).
struct SquareJitter {
    double shift = 0.06;      ///< in units of half the square's side
    double log_scale = 0.10;  ///< of the logarithm of its side
    double angle_degrees = 9.0;
};

[[nodiscard]] FaceSquare jittered(FaceSquare square, const SquareJitter& jitter, Rng& rng);

/// A variation of an example: moved, mirrored, in front of a part of one of the backgrounds
/// (height, width, 3) or of a drawn one, covered in part, with other colours, blurred, noisy,
/// compressed.
[[nodiscard]] LandmarkTarget varied(const LandmarkExample& example,
                                    const std::vector<Tensor>& backgrounds, std::int64_t side,
                                    Rng rng);

}  // namespace stymo
