#include "fit/photo/model_mask.h"

#include "core/io/image.h"
#include "core/ops/ops.h"

namespace stymo {

Tensor head_probability(const Model& model, const Tensor& crop, const Pose& pose,
                        const Intrinsics& intrinsics) {
    constexpr std::int64_t samples_per_ray = 24;
    const Decoder& decoder = model.decoder();
    const auto side = static_cast<int>(decoder.ladder().largest());
    const Variable image = clamp(resize_image(crop, side, side), 0.0, 1.0);
    const Codes codes = detached(model.encoder()(reshape(image, {1, side, side, 3}) * 2.0 - 1.0));
    const Decoded face =
        decoder(codes, {camera_from_pose(pose, intrinsics)},
                {.samples_per_ray = samples_per_ray, .resolution = decoder.ladder().smallest()});
    const Tensor& transmittance = face.weights.transmittance.value();
    const std::int64_t rays = face.feature_map.shape(1);
    const Tensor opacity = (Variable(transmittance.reshaped({rays, rays, 1})) * -1.0 + 1.0).value();
    return clamp(resize_image(opacity, static_cast<int>(crop.shape(0)),
                              static_cast<int>(crop.shape(1))),
                 0.0, 1.0)
        .value();
}

}  // namespace stymo
