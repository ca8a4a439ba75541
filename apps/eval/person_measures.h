#pragma once

#include <filesystem>
#include <vector>

#include "apps/eval/evaluate.h"
#include "apps/eval/score.h"
#include "fit/photo/face_detector.h"
#include "nn/models/identity_network.h"
#include "render/morphable/head.h"

namespace stymo {

/// Measures whether a fitted face shows the same person as its photo, also from the side: cosines
/// between embeddings of a face recognition network.
class IdentityMeasure {
public:
    /// `weights` are those of MobileFaceNet, from `stymo-weights import`. Throws FileError for a
    /// file that cannot be used.
    explicit IdentityMeasure(const std::filesystem::path& weights) : network_(weights) {}

    /// The score of the fitted codes of `fit`. `other` is a photo of another person, or null.
    [[nodiscard]] IdentityScore measure(const Model& model, const ComparedFace& face,
                                        const ComparedFace* other, const FitResult& fit) const;

    /// The embedding, of unit length, of an image (S, S, 3) in [0, 1] with the head on black, seen
    /// by `camera`. It is first brought into FFHQ's crop (ffhq_frame of the model's camera).
    [[nodiscard]] std::vector<double> embedding(const Tensor& image, const Camera& camera,
                                                const CameraConfig& model) const;

private:
    IdentityNetwork network_;
};

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
