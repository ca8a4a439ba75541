#include "apps/common/video_options.h"

#include <algorithm>
#include <iomanip>
#include <sstream>

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
