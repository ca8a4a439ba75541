#pragma once

#include <filesystem>

#include "apps/common/command_line.h"
#include "apps/fit/fitting.h"
#include "fit/video/video_fit.h"

namespace stymo {

/// Fits a film and writes `codes.jsonl`, a code file a line with the members "frame", "face" (false
/// where the frame does not show it and the line repeats the one before), "starts" and "roll_deg"
/// (of the head in the frame), and report.json. Throws what VideoFit throws, and Error, before
/// codes.jsonl exists, if the process is interrupted.
[[nodiscard]] AppResult fit_video(const Fitting& fitting, const std::filesystem::path& film,
                                  const std::filesystem::path& out, VideoFitOptions options);

}  // namespace stymo
