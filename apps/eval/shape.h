#pragma once

#include <filesystem>

#include "apps/eval/evaluate.h"
#include "apps/eval/score.h"
#include "fit/photo/face_detector.h"
#include "render/morphable/head.h"

namespace stymo {

/// Whether a fitted face has the shape of a face: where its landmarks are when it turns, and how
/// deep it is.
class ShapeMeasure {
public:
    /// `landmark_model` as FaceDetector's; `head`: the linear head whose codes the faces have.
    /// Throws as FaceDetector does.
    ShapeMeasure(const std::filesystem::path& landmark_model, MorphableHead head);

    /// Of the codes that `fit` ended with.
    [[nodiscard]] ShapeScore measure(const Model& model, const ComparedFace& face,
                                     const FitResult& fit) const;

private:
    FaceDetector detector_;
    MorphableHead head_;
};

/// The median of |depth - expected| over the pairs, after their median has been taken from all.
/// Infinite without pairs.
[[nodiscard]] double shifted_difference(std::vector<double> depth_minus_expected);

/// shifted_difference between a depth map (R, R, 1), distances along rays through the middles of
/// its pixels, and the surface of a head's vertices, within the convex hull of its 68 points, in
/// distances of its eyes.
[[nodiscard]] double depth_difference(const MorphableHead& head, const Tensor& vertices,
                                      const Camera& camera, const Tensor& depths);

}  // namespace stymo
