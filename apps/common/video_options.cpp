#include "apps/common/video_options.h"

#include <algorithm>
#include <iomanip>
#include <memory>
#include <optional>
#include <sstream>

#include "core/progress.h"

namespace stymo {

namespace {

double rate_of(const VideoSummary& summary) {
    return static_cast<double>(summary.frames) / std::max(summary.seconds, 1e-9);
}

}  // namespace

void declare_video(Command& command, VideoFitOptions& options) {
    command
        .option("--frame-steps", options.steps,
                "with --video: optimiser steps of each window of frames; 0: what the encoder sees")
        .range(0, 10000);
    command
        .option("--key-steps", options.key_steps,
                "with --video: optimiser steps for identity, texture and light")
        .range(0, 10000);
    command
        .option("--time-weight", options.time_weight,
                "with --video: weight of the term that draws the expressions of neighbouring "
                "frames together")
        .range(0, 1e6);
    command
        .option("--video-side", options.side,
                "with --video: side of the images that are compared, one that the model renders")
        .range(64, 512);
    command
        .option("--first-frame", options.first_frame,
                "with --video: number of the first frame that counts, from 0")
        .range(0, 1e9);
    command
        .option("--every", options.every,
                "with --video: takes each frame of this distance, so that a long film takes less "
                "time")
        .range(1, 10000);
    command
        .option("--most-frames", options.most_frames,
                "with --video: number of frames after which it ends; 0: at the film's end")
        .range(0, 1e9);
}

std::function<void(const char*, std::int64_t, std::int64_t)> video_progress() {
    struct Shown {
        std::string phase;
        std::optional<Progress> progress;
    };
    return [shown = std::make_shared<Shown>()](const char* phase, std::int64_t done,
                                               std::int64_t total) {
        if (shown->phase != phase) {
            shown->phase = phase;
            const bool steps = shown->phase == "person";
            shown->progress.emplace(
                ProgressTask{.title = phase, .total = total, .unit = steps ? "steps" : "frames"});
        }
        shown->progress->update(done);
    };
}

std::string text_of(const VideoSummary& summary) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << summary.frames << " frames, " << summary.found
         << " with the face, in " << summary.starts
         << (summary.starts == 1 ? " shot, " : " shots, ") << summary.cuts
         << (summary.cuts == 1 ? " cut" : " cuts") << "; photometric loss " << summary.loss
         << "; person " << std::setprecision(1) << summary.person_seconds << " s, "
         << std::setprecision(2) << rate_of(summary) << " frames a second";
    return text.str();
}

JsonValue to_json(const VideoSummary& summary) {
    return JsonValue::object({{"frames", summary.frames},
                              {"found", summary.found},
                              {"held", summary.frames - summary.found},
                              {"shots", summary.starts},
                              {"cuts", summary.cuts},
                              {"photometric", summary.loss},
                              {"person_seconds", summary.person_seconds},
                              {"seconds", summary.seconds},
                              {"fitted_frames_a_second", rate_of(summary)}});
}

}  // namespace stymo
