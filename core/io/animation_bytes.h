#pragma once

#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// Animations of frames (height, width, 3) of one size in [0, 1], encoded in memory, that repeat
/// endlessly. They throw FileError if the frames cannot be encoded.

/// All frames have one palette of 255 colours: the frames' own if they have no more, otherwise the
/// centres of a k-means clustering in which rare colours count more than their pixels. No pixel is
/// dithered.
[[nodiscard]] std::string gif_bytes(const std::vector<Tensor>& frames, double frames_per_second);
/// Lossy WebP.
[[nodiscard]] std::string webp_bytes(const std::vector<Tensor>& frames, double frames_per_second);

}  // namespace stymo
