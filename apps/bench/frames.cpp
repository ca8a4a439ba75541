#include "apps/bench/frames.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/metrics.h"

namespace stymo {

namespace {

double largest_difference(const Tensor& a, const Tensor& b) {
    double largest = 0.0;
    const std::span<const float> left = a.values<float>(), right = b.values<float>();
    for (std::size_t i = 0; i < left.size(); ++i)
        largest = std::max(largest,
                           std::abs(static_cast<double>(left[i]) - static_cast<double>(right[i])));
    return largest;
}

}  // namespace

Timing time_frames(const BenchSubject& subject, FaceRenderer& renderer, int repeats) {
    const double seconds_of_a_face = 0.04 * repeats;
    Timing timing;
    std::size_t view = 0;
    for (std::int64_t face = 0; face < subject.codes.batch(); ++face) {
        renderer.show(subject.codes, face);
        const auto next = [&] {
            static_cast<void>(renderer.render(subject.views[view++ % subject.views.size()]));
        };
        timing.add(time_repeated(repeats, seconds_of_a_face, next));
    }
    return timing;
}

Images all_images(const BenchSubject& subject, const RendererOptions& options) {
    FaceRenderer renderer(subject.model, options);
    Images images;
    for (std::int64_t face = 0; face < subject.codes.batch(); ++face) {
        renderer.show(subject.codes, face);
        for (const Camera& view : subject.views) images.push_back(renderer.render(view).image);
    }
    return images;
}

ImageError error_of(const Images& images, const Images& exact) {
    ImageError error;
    double squares = 0.0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
        const double psnr = peak_signal_to_noise_ratio(images.at(i), exact[i]);
        error.psnr_mean += psnr / static_cast<double>(exact.size());
        error.psnr_worst = std::min(error.psnr_worst, psnr);
        error.worst_pixel = std::max(error.worst_pixel, largest_difference(images[i], exact[i]));
        squares += std::pow(10.0, -psnr / 10.0) / static_cast<double>(exact.size());
    }
    error.root_mean_square = std::sqrt(squares);
    return error;
}

}  // namespace stymo
