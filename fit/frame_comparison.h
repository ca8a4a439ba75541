#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "nn/models/model.h"
#include "render/rasterizer.h"

namespace stymo {

/// A face as something else draws it, beside the model's own frame from one side, on black.
struct FrameComparison {
    double yaw = 0.0;          ///< in degrees
    Tensor frame, rendered;    ///< (S, S, 3)
    double psnr = 0.0;         ///< of the whole images, in decibels
    double psnr_inside = 0.0;  ///< where both have the head
    double overlap = 0.0;      ///< area that both have, as a share of what at least one has
};
/// Colours and coverage of a square image.
using DrawnFrom = std::function<RasterImage(const Camera& camera, std::int64_t side)>;
/// One comparison for each of `yaws` (degrees) around the middle of the head, in the model's
/// resolution. Throws what `render_view` and `draw` throw.
[[nodiscard]] std::vector<FrameComparison> compared_with_frames(const Model& model,
                                                                const Codes& codes,
                                                                const DrawnFrom& draw,
                                                                const std::vector<double>& yaws);

}  // namespace stymo
