#pragma once

#include <cstdint>
#include <filesystem>

#include "core/tensor.h"
#include "fit/video/video_fit.h"

namespace stymo {

/// Frames of a film that was driven by another: eight of them, evenly chosen, each below the frame
/// of `film` that it follows. `frames`: the number of frames of `driven`, which are those of `film`
/// that `options` name.
[[nodiscard]] Tensor contact_sheet(const std::filesystem::path& film,
                                   const std::filesystem::path& driven, std::int64_t frames,
                                   const VideoFitOptions& options);

}  // namespace stymo
