#pragma once

#include <span>
#include <vector>

#include "core/tensor.h"
#include "fit/photo/landmarks.h"
#include "render/camera.h"
#include "render/morphable/head.h"

namespace stymo {

/// One photo of one head.
struct MorphableFitTarget {
    Landmarks landmarks;  ///< in pixels of `image`
    Tensor image;         ///< (S, S, 3) in [0, 1]
    Tensor mask;  ///< (S, S, 1), the head where values are at least 0.5; undefined: the whole image
    /// (S, S, 1), see nn/known_pixels.h; undefined: all pixels are known. A landmark on an unknown
    /// one is a guess and counts a twenty-fifth.
    Tensor known{};
    /// The identity code (100) of the head, if it is known; empty: it is fitted.
    std::vector<float> identity{};
};

struct MorphableFitOptions {
    /// Whether colours are fitted after the landmarks. If not, texture is zero and light neutral.
    bool pixels = true;
    /// Standard deviations of a detector's points from the head's, in units of the image side:
    /// inner points, and points of the jaw. Detectors find the latter on the outline of hair and
    /// cheeks, which draws the yaw of a turned head towards the front.
    double landmark_deviation = 0.006;
    double jaw_deviation = 0.08;
    /// Standard deviation of the photo's colours from the head's.
    double color_deviation = 0.1;
    /// Number of independent observations that the pixels of a face count as.
    double color_observations = 500.0;
    int landmark_steps = 12;
    int pixel_steps = 8;
};

/// The most probable pose and codes. docs/morphable-models.md says how they are found.
struct MorphableFit {
    Pose pose;
    std::vector<float> identity;    ///< 100
    std::vector<float> expression;  ///< 79; one-sided expressions are >= 0
    std::vector<float> texture;     ///< 100
    std::vector<float> light;       ///< 27, render/spherical_harmonics.h
    double landmark_error = 0.0;    ///< root mean square distance of given and fitted landmarks on
                                    ///< known pixels, in units of the image side
};

/// Fits a linear head to each photo separately, on all threads: the pose in closed form, then pose
/// and shape to the landmarks, then all unknowns to landmarks and colours, by Levenberg-Marquardt
/// steps whose Jacobians come from core/autograd. A known identity is no unknown. The points of the
/// jaw move on the head to its outline in the view. Throws ShapeError for images that are not
/// square or have other shapes or identities of another size, ValueError for landmarks that are not
/// finite or are collinear.
[[nodiscard]] std::vector<MorphableFit> fit_morphable(const MorphableHead& head,
                                                      std::span<const MorphableFitTarget> targets,
                                                      const Intrinsics& intrinsics,
                                                      const MorphableFitOptions& options = {});

}  // namespace stymo
