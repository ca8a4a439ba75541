#pragma once

#include <span>

#include "nn/realtime/face_renderer.h"

namespace stymo {

/// PSNR in decibels of a mode's frames against exact frames, over several views.
struct FrameError {
    double mean_psnr = 0.0;
    double worst_psnr = 0.0;
};

/// A value of RendererOptions::tolerance with the error of its frames.
struct ChosenTolerance {
    double tolerance = 0.0;
    FrameError error;
};

/// The error of frames with `options` for one face (row 0) and these cameras, at least one. A frame
/// that equals the exact one counts as 100 dB.
[[nodiscard]] FrameError frame_error(const Model& model, const Codes& codes,
                                     std::span<const Camera> cameras,
                                     const RendererOptions& options);

/// The largest tolerance for which the frames of this face have a mean PSNR of at least `psnr`
/// against exact frames; the smallest tolerance if there is none. The candidates go from 0.5 down
/// to 0.001 by factors of sqrt(2). Modes without a tolerance return that of
/// `options`. Bisection renders one exact frame and about five frames of the mode for each camera.
/// Throws ValueError without cameras.
[[nodiscard]] ChosenTolerance choose_tolerance(const Model& model, const Codes& codes,
                                               std::span<const Camera> cameras,
                                               const RendererOptions& options, double psnr);

}  // namespace stymo
