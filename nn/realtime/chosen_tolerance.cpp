#include "nn/realtime/chosen_tolerance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/metrics.h"

namespace stymo {

namespace {

constexpr double largest_tolerance = 0.5;
constexpr int series_length = 19;
constexpr double psnr_of_equal_frames = 100.0;

double series_tolerance(int index) {
    return largest_tolerance * std::pow(2.0, -0.5 * index);
}

std::vector<Tensor> frames(const Model& model, const Codes& codes, std::span<const Camera> cameras,
                           const RendererOptions& options) {
    FaceRenderer renderer(model, options);
    renderer.show(codes);
    std::vector<Tensor> images;
    for (const Camera& camera : cameras) images.push_back(renderer.render(camera).image);
    return images;
}

std::vector<Tensor> exact_frames(const Model& model, const Codes& codes,
                                 std::span<const Camera> cameras, RendererOptions options) {
    if (cameras.empty()) fail<ValueError>("the error of frames needs at least one camera");
    options.mode = RenderMode::exact;
    return frames(model, codes, cameras, options);
}

FrameError error_between(std::span<const Tensor> images, std::span<const Tensor> exact) {
    FrameError error{.mean_psnr = 0.0, .worst_psnr = psnr_of_equal_frames};
    for (std::size_t i = 0; i < images.size(); ++i) {
        const double psnr =
            std::min(peak_signal_to_noise_ratio(images[i], exact[i]), psnr_of_equal_frames);
        error.mean_psnr += psnr / static_cast<double>(images.size());
        error.worst_psnr = std::min(error.worst_psnr, psnr);
    }
    return error;
}

}  // namespace

FrameError frame_error(const Model& model, const Codes& codes, std::span<const Camera> cameras,
                       const RendererOptions& options) {
    return error_between(frames(model, codes, cameras, options),
                         exact_frames(model, codes, cameras, options));
}

ChosenTolerance choose_tolerance(const Model& model, const Codes& codes,
                                 std::span<const Camera> cameras, const RendererOptions& options,
                                 double psnr) {
    const std::vector<Tensor> exact = exact_frames(model, codes, cameras, options);
    const auto at = [&](double tolerance) {
        RendererOptions tried = options;
        tried.tolerance = tolerance;
        return ChosenTolerance{tolerance,
                               error_between(frames(model, codes, cameras, tried), exact)};
    };
    if (!tolerates(options.mode)) return at(options.tolerance);
    int low = 0,
        high = series_length - 1;  // indices into the series; the last one is always accepted
    ChosenTolerance chosen = at(series_tolerance(high));
    while (low < high) {
        const int middle = (low + high) / 2;
        const ChosenTolerance tried = at(series_tolerance(middle));
        if (tried.error.mean_psnr >= psnr) {
            high = middle;
            chosen = tried;
        } else {
            low = middle + 1;
        }
    }
    return chosen;
}

}  // namespace stymo
