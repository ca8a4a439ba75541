#pragma once

#include <functional>
#include <string>

#include "apps/common/command_line.h"
#include "fit/video/video_fit.h"

namespace stymo {

/// Declares the options of fits to films.
void declare_video(Command& command, VideoFitOptions& options);
/// Shows the phases of a fit, for VideoFitOptions::on_progress.
[[nodiscard]] std::function<void(const char*, std::int64_t, std::int64_t)> video_progress();
/// A few lines for people.
[[nodiscard]] std::string text_of(const VideoSummary& summary);
[[nodiscard]] JsonValue to_json(const VideoSummary& summary);

}  // namespace stymo
