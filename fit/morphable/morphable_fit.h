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
    Tensor mask;  ///< (S, S, 1), the head at values of 0.5 and more; undefined: the whole image
};

struct MorphableFitOptions {
    /// Whether colours are fitted after the landmarks. Without, texture is zero and light neutral.
    bool pixels = true;
    /// What a detector's points differ from the head's by, in units of the image side: inner points
    /// and those of the jaw.
    double landmark_deviation = 0.006;
    double jaw_deviation = 0.02;
    /// What colours differ from the head's by.
    double color_deviation = 0.1;
    /// How many independent observations the pixels of a face are worth.
    double color_observations = 500.0;
    int landmark_steps = 12;
    int pixel_steps = 8;
};

/// The most probable pose and codes; what is minimised: docs/morphable-models.md.
struct MorphableFit {
    Pose pose;
    std::vector<float> identity;    ///< 100
    std::vector<float> expression;  ///< 79; one-sided ones are >= 0
    std::vector<float> texture;     ///< 100
    std::vector<float> light;       ///< 27, render/spherical_harmonics.h
    double landmark_error = 0.0;    ///< root mean square distance of given and fitted landmarks, in
                                    ///< units of the image side
};

/// Fits a linear head to photos, each by itself, on all threads: the pose in closed form, then pose
/// and shape to the landmarks, then everything to landmarks and colours, by Gauss-Newton steps
/// whose Jacobians are gradients of core/autograd. The points of the jaw slide on the head to where
/// the view sees its outline. Throws ShapeError for images that are not square or of other shapes,
/// ValueError for landmarks that are not finite or lie all on one line.
[[nodiscard]] std::vector<MorphableFit> fit_morphable(const MorphableHead& head,
                                                      std::span<const MorphableFitTarget> targets,
                                                      const Intrinsics& intrinsics,
                                                      const MorphableFitOptions& options = {});

/// Where the fitted head has the 68 landmarks, the jaw's on the outline, in pixels of an image of
/// this side.
[[nodiscard]] Landmarks fitted_landmarks(const MorphableHead& head, const MorphableFit& fit,
                                         const Intrinsics& intrinsics, std::int64_t side);

}  // namespace stymo
