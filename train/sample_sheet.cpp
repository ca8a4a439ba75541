#include "train/sample_sheet.h"

#include <algorithm>

#include "core/angle.h"
#include "core/io/image.h"
#include "nn/models/display_image.h"
#include "nn/models/face_batch.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

constexpr std::int64_t faces_shown = 6;

}  // namespace

Tensor sample_sheet(const Model& model, const Dataset& faces, std::int64_t resolution,
                    std::int64_t samples_per_ray, const PhotoOffsets* offsets) {
    std::vector<Tensor> tiles;
    for (std::int64_t index = 0; index < std::min(faces_shown, faces.size()); ++index) {
        const FaceBatch batch =
            make_batch(std::vector{faces.load(index)}, model.decoder().ladder().smallest());
        const Codes codes = face_codes(model, batch, offsets);
        const auto show = [&](const Camera& camera) {
            tiles.push_back(
                render_view(model, codes, 0, camera,
                            {.samples_per_ray = samples_per_ray, .resolution = resolution})
                    .image);
        };
        const auto target = std::ranges::find(batch.targets, resolution,
                                              [](const Tensor& images) { return images.shape(1); });
        tiles.push_back(display_image(*target, 0));
        show(face_cameras(batch, offsets).front());
        for (const double yaw_degrees : {-30.0, 0.0, 30.0}) {
            show(model_camera(model, radians_from_degrees(yaw_degrees), 0.0, 0.0));
        }
    }
    return tile_images(tiles, 5);
}

}  // namespace stymo
