#include "train/validation.h"

#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "nn/models/display_image.h"
#include "nn/models/face_batch.h"

namespace stymo {

ValidationScore validation_score(const Model& model, const ReconstructionLoss& reconstruction,
                                 const Dataset& faces, std::int64_t count, std::int64_t resolution,
                                 std::int64_t samples_per_ray) {
    ValidationScore sum;
    for (std::int64_t index = 0; index < count; ++index) {
        const FaceBatch batch =
            make_batch(std::vector{faces.load(index)}, model.decoder().ladder().smallest());
        const Codes codes = face_codes(model, batch);
        const Decoded decoded = model.decoder()(
            codes, batch.cameras, {.samples_per_ray = samples_per_ray, .resolution = resolution});
        const ReconstructionLoss::Target target = reconstruction.target(batch.targets, resolution);
        sum.reconstruction += reconstruction(decoded.images, target).total.value().item();
        const int side = static_cast<int>(resolution);
        const Tensor mask = clamp(resize_bicubic(batch.mask, side, side), 0.0, 1.0).value();
        sum.psnr += peak_signal_to_noise_ratio(
            masked_image(display_image(decoded.images.back().value(), 0), display_mask(mask, 0)),
            display_image(target.images.back(), 0));
    }
    return {sum.reconstruction / static_cast<double>(count), sum.psnr / static_cast<double>(count)};
}

}  // namespace stymo
