#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "fit/fit_job.h"
#include "fit/video/video_fit.h"

namespace stymo {

/// The options of fits and tuning, which are the same in all tools.
struct FitToolOptions {
    FitJobOptions job{};
    std::string optimizer = "adam";
    std::optional<std::int64_t> samples{};  ///< empty: the model's setting

    /// The options of the job with optimiser and samples.
    [[nodiscard]] FitJobOptions job_options() const;
};

/// Declares --steps, --optimizer and all other options of fits and tuning.
void declare_fit(Command& command, FitToolOptions& options);

/// Declares which frames of a film count.
void declare_film(Command& command, FilmOptions& options);
/// Declares the options of fits to films.
void declare_video(Command& command, VideoFitOptions& options);
/// Shows the phases, for FilmOptions::on_progress.
[[nodiscard]] std::function<void(const char*, std::int64_t, std::int64_t)> video_progress();
/// A line for people.
[[nodiscard]] std::string text_of(const FilmSummary& summary);
[[nodiscard]] JsonValue to_json(const FilmSummary& summary);

}  // namespace stymo
