#pragma once

#include <filesystem>

#include "apps/eval/evaluate.h"
#include "apps/eval/score.h"
#include "fit/photo/face_detector.h"
#include "render/morphable/head.h"

namespace stymo {

/// Measures the 3D shape of a fitted face: the landmarks of turned views, and the depth map.
class ShapeMeasure {
public:
    /// `landmark_model` as in FaceDetector; `head` is the linear head to which the faces' codes
    /// belong. Throws what FaceDetector throws.
    ShapeMeasure(const std::filesystem::path& landmark_model, MorphableHead head);

    /// The score of the fitted codes of `fit`.
    [[nodiscard]] ShapeScore measure(const Model& model, const ComparedFace& face,
                                     const FitResult& fit) const;

private:
    FaceDetector detector_;
    MorphableHead head_;
};

/// The median of |depth - expected| after subtracting the median of (depth - expected). Infinite
/// for an empty list.
[[nodiscard]] double shifted_difference(std::vector<double> depth_minus_expected);

/// shifted_difference between a depth map (R, R, 1), with distances along rays through pixel
/// centres, and the surface of a head's vertices, within the convex hull of its 68 landmarks, in
/// units of the distance of its eyes.
[[nodiscard]] double depth_difference(const MorphableHead& head, const Tensor& vertices,
                                      const Camera& camera, const Tensor& depths);

}  // namespace stymo
