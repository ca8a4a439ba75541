#include "nn/realtime/view.h"

#include <algorithm>
#include <cmath>

#include "core/ops/ops.h"
#include "nn/models/display_image.h"
#include "nn/realtime/face_renderer.h"

namespace stymo {

namespace {

double significant_share(const Tensor& weights) {
    const std::vector<double> all = weights.to_vector();
    return static_cast<double>(std::ranges::count_if(
               all, [](double weight) { return weight > significant_weight; })) /
           static_cast<double>(all.size());
}

double largest(const Tensor& values) {
    const std::vector<double> all = values.to_vector();
    return *std::ranges::max_element(all);
}

}  // namespace

void require_finite(const View& view) {
    for (const Tensor* part : {&view.image, &view.mask, &view.depth})
        if (part->defined()) require_finite(*part);
}

Variable expected_depth(const Decoded& decoded) {
    const Tensor& depths = decoded.samples.depths;
    return composite_depth(decoded.weights, depths, largest(depths));
}

View render_view(const Model& model, const Codes& codes, std::int64_t index, const Camera& camera,
                 const ViewOptions& options) {
    // The renderer computes in float32.
    if (codes.groups[0].dtype() != DType::float32)
        return decoded_view(model, codes, index, camera, options);
    FaceRenderer renderer(model, {.mode = RenderMode::exact,
                                  .samples_per_ray = options.samples_per_ray,
                                  .resolution = options.resolution,
                                  .mask = options.mask,
                                  .depth = options.depth});
    renderer.show(codes, index);
    return renderer.render(camera);
}

View decoded_view(const Model& model, const Codes& codes, std::int64_t index, const Camera& camera,
                  const ViewOptions& options) {
    const Decoded decoded = model.decoder()(codes_of_face(codes, index), {camera},
                                            {.samples_per_ray = options.samples_per_ray,
                                             .resolution = options.resolution,
                                             .mask = options.mask});
    View view{.image = display_image(decoded.images.back().value(), 0),
              .mask = {},
              .depth = {},
              .opacity = {},
              .significant_samples = significant_share(decoded.weights.weights.value())};
    if (options.mask) view.mask = display_mask(sigmoid(decoded.mask_logit).value(), 0);
    if (options.depth) {
        const auto side =
            std::llround(std::sqrt(static_cast<double>(decoded.samples.depths.shape(1))));
        view.depth = expected_depth(decoded).value().reshaped({side, side, 1});
        view.background_depth = largest(decoded.samples.depths);
        view.opacity = (-decoded.weights.transmittance + 1.0).value().reshaped({side, side, 1});
    }
    require_finite(view);
    return view;
}

Pose frontal_pose(const CameraConfig& camera) {
    return pivot_pose(0.0, 0.0, 0.0, camera.distance, camera.pivot_depth);
}

Camera model_camera(const Model& model, double yaw, double pitch, double roll) {
    const CameraConfig& camera = model.config().camera;
    return turned_camera(camera, camera.pivot_depth, yaw, pitch, roll);
}

double usual_distance(const CameraConfig& camera, const Pose& photo) {
    const Eigen::Vector3d middle(0.0, 0.0, head_middle);
    const Camera own = camera_from_pose(photo, camera.intrinsics);
    const double times = (own.center - middle).norm() / (camera.distance - head_middle);
    // Photos have the whole head in the middle, views the middle of the head without its hair.
    // Drawn faces have poses at the usual distance.
    constexpr double margin = 1.1, rounding = 1e-3;
    return times > whole_head_distance + rounding ? margin * times : whole_head_distance;
}

Camera turned_about_head(Camera camera, double yaw, double pitch) {
    const Eigen::Matrix3d turn = rotation_from_angles(yaw, pitch, 0.0);
    const Eigen::Vector3d middle(0.0, 0.0, head_middle);
    camera.world_from_camera = turn * camera.world_from_camera;
    camera.center = turn * (camera.center - middle) + middle;
    return camera;
}

Camera turned_camera(const CameraConfig& camera, double turning_z, double yaw, double pitch,
                     double roll, double times) {
    const double distance = turning_z + times * (camera.distance - turning_z);
    return camera_from_pose(pivot_pose(yaw, pitch, roll, distance, turning_z), camera.intrinsics);
}

}  // namespace stymo
