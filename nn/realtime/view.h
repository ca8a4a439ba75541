#pragma once

#include "nn/models/model.h"

namespace stymo {

struct ViewOptions {
    std::int64_t samples_per_ray = 64;
    std::int64_t resolution = 0;  ///< 0: the model's resolution
    bool mask = false;
    bool depth = false;
};

/// One face seen by one camera.
struct View {
    Tensor image;    ///< (S, S, 3) in [0, 1]
    Tensor mask;     ///< (S, S, 1) in [0, 1], undefined unless asked for
    Tensor depth;    ///< (R, R, 1), for each ray the expected Euclidean distance from the camera;
                     ///< undefined unless asked for
    Tensor opacity;  ///< (R, R, 1) in [0, 1], of each ray; undefined unless depth was asked for
    double background_depth =
        0.0;  ///< the part of `depth` that a ray's remaining light counts with
    /// Fraction of the samples whose compositing weight exceeds `significant_weight`.
    double significant_samples = 1.0;
};

/// Throws NumericError for a view that is not finite. Every renderer of views calls it, because a
/// file would show what is not a number as black.
void require_finite(const View& view);

/// A sample of smaller weight is invisible: it changes a pixel by less than half of an 8-bit step.
inline constexpr double significant_weight = 1e-3;

/// The expected depth of each ray of a decoded batch, (B, R, 1). Rays that hit nothing have the
/// depth of the farthest sample of all rays.
[[nodiscard]] Variable expected_depth(const Decoded& decoded);

/// Renders row `index` of codes in Z with a FaceRenderer of mode `exact`: every sample, in float32.
/// Rays that hit nothing have the depth of the farthest sample of all rays.
[[nodiscard]] View render_view(const Model& model, const Codes& codes, std::int64_t index,
                               const Camera& camera, const ViewOptions& options);

/// The same with the decoder that training uses, which also shows what lies outside the volume that
/// was trained (samples_in_trained_volume). There it differs: cameras from twice the model's
/// distance on see other things there. It is the reference implementation of the renderer, and
/// renders models that `FaceRenderer` cannot: those whose decoder does not fold and those in
/// float64.
[[nodiscard]] View decoded_view(const Model& model, const Codes& codes, std::int64_t index,
                                const Camera& camera, const ViewOptions& options);

/// The frontal pose, for a photo whose pose is unknown.
[[nodiscard]] Pose frontal_pose(const CameraConfig& camera);
/// The camera of this model for a head turned by these angles (radians), with the face in the
/// middle of the image.
[[nodiscard]] Camera model_camera(const Model& model, double yaw, double pitch, double roll);

/// World z of the middle of the head. Around it a head turns without leaving the image from a yaw
/// of -45 to 45 degrees; around the face, as in model_camera, it leaves it.
inline constexpr double head_middle = 0.1;
/// From this multiple of the model's distance an image rarely cuts the hair of a head.
inline constexpr double whole_head_distance = 1.15;
/// The multiple from which the head of a photo with this pose is shown whole: that one, or a tenth
/// farther than the photo if its crop is wide, as it is where there is much hair.
[[nodiscard]] double usual_distance(const CameraConfig& camera, const Pose& photo);
/// The camera turned about the middle of the head by these angles (radians).
[[nodiscard]] Camera turned_about_head(Camera camera, double yaw, double pitch);
/// The frontal camera turned around the point (0, 0, turning_z) by these angles (radians), at
/// `times` its distance from that point.
[[nodiscard]] Camera turned_camera(const CameraConfig& camera, double turning_z, double yaw,
                                   double pitch, double roll, double times = 1.0);

}  // namespace stymo
