#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "nn/realtime/face_renderer.h"

namespace stymo {

/// Largest error of a pixel in the checked views at 45 dB.
inline constexpr double largest_pixel_error = 0.15;

/// One face seen by one camera.
struct FaceView {
    Codes codes;  ///< in Z, one row
    Camera camera;
};

/// Error of frames against exact frames of the same views.
struct FrameError {
    double worst_psnr = 100.0;  ///< decibels, of the worst view; equal images count as 100
    double worst_pixel = 0.0;   ///< largest difference of any value of any view
    std::int64_t views = 0;     ///< number of views that were compared

    void add(const Tensor& image, const Tensor& exact);
    /// Whether every view has `psnr`, and no pixel is off by more than `largest_pixel_error` at 45
    /// dB, half of that at 51 dB, and so on.
    [[nodiscard]] bool within(double psnr) const;
};

/// A renderer for a list of views, and what was measured to choose it.
struct ChosenRenderer {
    FaceRenderer renderer;
    RenderMode mode = RenderMode::exact;
    double tolerance = 0.0;
    FrameError error;               ///< of the checked views
    std::int64_t exact_frames = 0;  ///< frames that were rendered to choose
    std::int64_t fast_frames = 0;
};

/// One view in so many is checked, at most `most_checked_views`, with at most `most_tolerances`
/// tolerances. So the choice costs at most 1/16 of the exact frames that the views would take, and
/// a quarter as many frames of the mode as there are views.
inline constexpr std::int64_t views_per_check = 16;
inline constexpr std::int64_t most_checked_views = 6;
inline constexpr std::int64_t most_tolerances = 4;

/// Decibels that checked views need beyond the wanted ones, because others may be worse.
inline constexpr double spare_decibels = 1.5;

/// A renderer of options.mode whose frames of these views are within `psnr` of exact frames. Checks
/// some of the views, evenly spread. Tolerances go down by factors of 2 from options.tolerance, or
/// from a smaller one if more than 45 dB are wanted. The renderer is exact if none suffices, if the
/// mode tolerates none, and for fewer than `views_per_check` views. Throws what FaceRenderer and
/// its `show` throw.
[[nodiscard]] ChosenRenderer choose_renderer(const Model& model, std::span<const FaceView> views,
                                             const RendererOptions& options, double psnr);

/// What was measured, in words for users: "every frame is exact" if nothing was checked.
[[nodiscard]] std::string error_words(const ChosenRenderer& chosen);

}  // namespace stymo
