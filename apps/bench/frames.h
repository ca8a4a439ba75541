#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/bench/timing.h"
#include "nn/realtime/face_renderer.h"

namespace stymo {

/// Times frames of each face in turn. Consecutive frames have different views.
[[nodiscard]] Timing time_frames(const BenchSubject& subject, FaceRenderer& renderer, int repeats);

/// Images of every face in every view, for comparison.
using Images = std::vector<Tensor>;
[[nodiscard]] Images all_images(const BenchSubject& subject, const RendererOptions& options);

/// Errors of images against exact ones, for values in [0, 1].
struct ImageError {
    double psnr_mean = 0.0;  ///< decibels, mean over the images
    /// Infinite if all images are equal.
    double psnr_worst = std::numeric_limits<double>::infinity();
    double root_mean_square = 0.0;  ///< over all values of all images
    double worst_pixel = 0.0;       ///< largest difference of any value
};
[[nodiscard]] ImageError error_of(const Images& images, const Images& exact);

}  // namespace stymo
