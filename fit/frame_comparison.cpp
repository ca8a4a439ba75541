#include "fit/frame_comparison.h"

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/metrics.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/view.h"

namespace stymo {

std::vector<FrameComparison> compared_with_frames(const Model& model, const Codes& codes,
                                                  const DrawnFrom& draw,
                                                  const std::vector<double>& yaws) {
    FaceRenderer renderer(model,
                          {.mode = RenderMode::exact, .mask = true, .remove_floaters = true});
    renderer.show(codes);
    std::vector<FrameComparison> result;
    for (const double yaw : yaws) {
        const Camera camera =
            turned_camera(model.config().camera, head_middle, radians_from_degrees(yaw), 0.0, 0.0);
        const View view = renderer.render(camera);
        RasterImage drawn = draw(camera, view.image.shape(0));
        FrameComparison& compared = result.emplace_back();
        compared.yaw = yaw;
        compared.frame = view.image;
        compared.rendered = std::move(drawn.color);
        double squares = 0.0, both = 0.0, any = 0.0;
        const auto frame = compared.frame.mutable_values<float>();
        for (std::size_t i = 0; i < frame.size(); ++i) {
            const float mask = view.mask.values<float>()[i / 3];
            frame[i] *= mask;
            const bool in_frame = mask >= 0.5F;
            const bool in_drawing = drawn.coverage.values<float>()[i / 3] >= 0.5F;
            any += in_frame || in_drawing ? 1.0 : 0.0;
            if (!in_frame || !in_drawing) continue;
            both += 1.0;
            const double difference =
                double{frame[i]} - double{compared.rendered.values<float>()[i]};
            squares += difference * difference;
        }
        compared.psnr = peak_signal_to_noise_ratio(compared.frame, compared.rendered);
        compared.psnr_inside = 10.0 * std::log10(both / std::max(squares, 1e-12));
        compared.overlap = both / std::max(any, 1.0);
    }
    return result;
}

}  // namespace stymo
