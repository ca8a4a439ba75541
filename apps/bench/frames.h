#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/bench/timing.h"
#include "nn/models/realtime/face_renderer.h"

namespace stymo {

/// Times frames of each face in turn, every one from another side than the one before.
[[nodiscard]] Timing time_frames(const BenchSubject& subject, FaceRenderer& renderer, int repeats);

/// The images of every face from every side that others are held against.
using Images = std::vector<Tensor>;
[[nodiscard]] Images all_images(const BenchSubject& subject, const RendererOptions& options);

/// How far images are from those that they stand for; peak 1.
struct ImageError {
    double psnr_mean = 0.0;                                       ///< dB, mean over the images
    double psnr_worst = std::numeric_limits<double>::infinity();  ///< infinite where all are equal
    double root_mean_square = 0.0;  ///< over all numbers of all images
    double worst_pixel = 0.0;       ///< largest difference of any number of any image
};
[[nodiscard]] ImageError error_of(const Images& images, const Images& exact);

}  // namespace stymo
