#include "nn/realtime/chosen_tolerance.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <vector>

#include "core/metrics.h"

namespace stymo {

namespace {

constexpr double psnr_of_equal_frames = 100.0;

Tensor frame(FaceRenderer& renderer, const FaceView& view) {
    renderer.show(view.codes);
    return renderer.render(view.camera).image;
}

/// The views in the middle of `count` equal parts of the list.
std::vector<FaceView> spread(std::span<const FaceView> views, std::int64_t count) {
    std::vector<FaceView> chosen;
    for (std::int64_t i = 0; i < count; ++i)
        chosen.push_back(
            views[static_cast<std::size_t>((2 * i + 1) * std::ssize(views) / (2 * count))]);
    return chosen;
}

/// By what factor errors may be larger than those at 45 dB. Six decibels are a factor of two.
double allowed_factor(double psnr) {
    constexpr double usual_psnr = 45.0, decibels_per_factor_of_two = 6.0;
    return std::exp2((usual_psnr - psnr) / decibels_per_factor_of_two);
}

}  // namespace

void FrameError::add(const Tensor& image, const Tensor& exact) {
    worst_psnr = std::min(worst_psnr, peak_signal_to_noise_ratio(image, exact));
    const std::span<const float> a = image.values<float>(), b = exact.values<float>();
    for (std::size_t i = 0; i < a.size(); ++i)
        worst_pixel = std::max(worst_pixel, static_cast<double>(std::abs(a[i] - b[i])));
    ++views;
}

bool FrameError::within(double psnr) const {
    return worst_psnr >= psnr && worst_pixel <= largest_pixel_error * allowed_factor(psnr);
}

ChosenRenderer choose_renderer(const Model& model, std::span<const FaceView> views,
                               const RendererOptions& options, double psnr) {
    RendererOptions exact_options = options;
    exact_options.mode = RenderMode::exact;
    const std::int64_t count = std::min(std::ssize(views) / views_per_check, most_checked_views);
    ChosenRenderer exact{.renderer = FaceRenderer(model, exact_options), .error = {}};
    if (!tolerates(options.mode) || count == 0) return exact;

    const std::vector<FaceView> checked = spread(views, count);
    std::vector<Tensor> expected;
    for (const FaceView& view : checked) expected.push_back(frame(exact.renderer, view));
    ChosenRenderer fast{
        .renderer = FaceRenderer(model, options),
        .mode = options.mode,
        .tolerance = std::min(options.tolerance, default_tolerance * allowed_factor(psnr)),
        .error = {},
        .exact_frames = count};
    const double wanted = std::min(psnr + spare_decibels, psnr_of_equal_frames);
    const auto suffices = [&] {
        return fast.error.worst_psnr >= wanted && fast.error.within(psnr);
    };
    for (std::int64_t i = 0; i < most_tolerances; ++i, fast.tolerance *= 0.5) {
        fast.renderer.set_tolerance(fast.tolerance);
        fast.error = {};
        for (std::size_t k = 0; k < checked.size() && suffices(); ++k) {
            fast.error.add(frame(fast.renderer, checked[k]), expected[k]);
            ++fast.fast_frames;
        }
        if (suffices()) return fast;
    }
    exact.exact_frames = fast.exact_frames;
    exact.fast_frames = fast.fast_frames;
    return exact;
}

std::string error_words(const ChosenRenderer& chosen) {
    if (chosen.error.views == 0) return "every frame is exact";
    std::ostringstream text;
    text << std::setprecision(3) << "at worst " << chosen.error.worst_psnr
         << " dB, and a pixel off by " << chosen.error.worst_pixel << ", against exact images of "
         << chosen.error.views << (chosen.error.views == 1 ? " view" : " of the views");
    return text.str();
}

}  // namespace stymo
