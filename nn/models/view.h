#pragma once

#include "nn/models/model.h"

namespace stymo {

struct ViewOptions {
    std::int64_t samples_per_ray = 64;
    std::int64_t resolution = 0;  ///< 0: the model's own
    bool mask = false;
    bool depth = false;
};

/// One face seen by one camera.
struct View {
    Tensor image;  ///< (S, S, 3) in [0, 1]
    Tensor mask;   ///< (S, S, 1) in [0, 1], undefined unless asked for
    Tensor depth;  ///< (R, R, 1) expected Euclidean distance from the camera of each ray, undefined
                   ///< unless asked for
    /// Share of the samples whose compositing weight exceeds `significant_weight`; 1 where it was
    /// not counted.
    double significant_samples = 1.0;
};

/// A sample of less weight cannot be seen: it moves a pixel by less than half of an 8-bit step.
inline constexpr double significant_weight = 1e-3;

/// Renders row `index` of codes in Z once, every sample in float32: a FaceRenderer of mode `exact`
/// that is made for this view. Rays that hit nothing have the depth of the farthest sample of all.
[[nodiscard]] View render_view(const Model& model, const Codes& codes, std::int64_t index,
                               const Camera& camera, const ViewOptions& options);

/// The same through the decoder as it is trained: the reference implementation of the renderer, and
/// what renders a model whose decoder does not fold or that is in float64.
[[nodiscard]] View decoded_view(const Model& model, const Codes& codes, std::int64_t index,
                                const Camera& camera, const ViewOptions& options);

/// The pose of a photo of which none is known.
[[nodiscard]] Pose frontal_pose(const CameraConfig& camera);
/// The camera of this model that sees the head turned by these angles (radians), the face in the
/// middle of the image.
[[nodiscard]] Camera model_camera(const Model& model, double yaw, double pitch, double roll);

}  // namespace stymo
