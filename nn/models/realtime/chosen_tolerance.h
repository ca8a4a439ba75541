#pragma once

#include <span>

#include "nn/models/realtime/face_renderer.h"

namespace stymo {

/// Differences of a mode's frames from exact ones over some views, as PSNR in decibels.
struct FrameError {
    double mean_psnr = 0.0;
    double worst_psnr = 0.0;
};

/// A tolerance of RendererOptions with the error of its frames.
struct ChosenTolerance {
    double tolerance = 0.0;
    FrameError error;
};

/// The error of `options` for one face (row 0) as seen by these cameras, at least one. Frames that
/// equal the exact ones count as 100 dB.
[[nodiscard]] FrameError frame_error(const Model& model, const Codes& codes,
                                     std::span<const Camera> cameras,
                                     const RendererOptions& options);

/// The largest tolerance, of a series from 0.5 down to 0.001 whose neighbours differ by the square
/// root of two, with frames of this face that are at least `psnr` decibels from exact ones on
/// average over the cameras; the smallest if none is. Modes without a tolerance (exact, baked) keep
/// that of `options`. Found by bisection, so that it costs one exact frame of each camera and about
/// five of the mode. Throws ValueError without cameras.
[[nodiscard]] ChosenTolerance choose_tolerance(const Model& model, const Codes& codes,
                                               std::span<const Camera> cameras,
                                               const RendererOptions& options, double psnr);

}  // namespace stymo
