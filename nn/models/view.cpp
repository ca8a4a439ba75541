#include "nn/models/view.h"

#include <algorithm>
#include <cmath>

#include "core/ops/ops.h"
#include "nn/models/picture.h"

namespace stymo {

namespace {

Codes row(const Codes& codes, std::int64_t index) {
    Codes result;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        result.groups[group] = slice(codes.groups[group], 0, index, index + 1);
    return result;
}

double counting_part(const Tensor& weights) {
    const std::vector<double> all = weights.to_vector();
    return static_cast<double>(std::ranges::count_if(all, [](double weight) { return weight > counting_weight; })) /
           static_cast<double>(all.size());
}

double largest(const Tensor& values) {
    const std::vector<double> all = values.to_vector();
    return *std::ranges::max_element(all);
}

}  // namespace

View render_view(const Model& model, const Codes& codes, std::int64_t index, const Camera& camera, const ViewOptions& options) {
    const Decoded decoded =
        model.decoder()(row(codes, index), {camera},
                        {.samples_per_ray = options.samples_per_ray, .resolution = options.resolution, .mask = options.mask});
    View view{picture(decoded.images.back().value(), 0), {}, {}, counting_part(decoded.weights.weights.value())};
    if (options.mask) view.mask = picture_mask(sigmoid(decoded.mask_logit).value(), 0);
    if (options.depth) {
        const auto side = std::llround(std::sqrt(static_cast<double>(decoded.samples.depths.shape(1))));
        view.depth = composite_depth(decoded.weights, decoded.samples.depths, largest(decoded.samples.depths))
                         .value()
                         .reshaped({side, side, 1});
    }
    return view;
}

Pose frontal_pose(const CameraConfig& camera) {
    return pivot_pose(0.0, 0.0, 0.0, camera.distance, camera.pivot_depth);
}

Camera model_camera(const Model& model, double yaw, double pitch, double roll) {
    const CameraConfig& place = model.config().camera;
    return camera_from_pose(pivot_pose(yaw, pitch, roll, place.distance, place.pivot_depth), place.intrinsics);
}

}  // namespace stymo
