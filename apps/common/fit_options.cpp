#include "apps/common/fit_options.h"

#include <algorithm>
#include <memory>

#include "apps/common/table.h"
#include "core/progress.h"

namespace stymo {

FitJobOptions FitToolOptions::job_options() const {
    FitJobOptions options = job;
    options.fit.optimizer = optimizer == "lbfgs" ? FitOptimizer::lbfgs : FitOptimizer::adam;
    if (samples) options.fit.samples_per_ray = *samples;
    return options;
}

namespace {

void declare_codes(Command& command, FitToolOptions& options) {
    FitOptions& fit = options.job.fit;
    command.option("--steps", fit.steps, "optimiser steps").range(0, 1e6);
    command
        .option("--optimizer", options.optimizer,
                "adam (the paper's) or lbfgs, which reaches the same loss in fewer steps; a step "
                "is one evaluation of loss and gradient")
        .one_of({"adam", "lbfgs"});
    command
        .option("--learning-rate", fit.learning_rate,
                "learning rate of the first step; 0: the model's setting")
        .range(0, 10);
    command.option("--decay", fit.decay, "Adam's factor on the learning rate after each step")
        .range(0, 1);
    command
        .option("--coarse-steps", fit.coarse_steps,
                "number of initial steps that compare images of 64 pixels, then 128, up to half "
                "of the largest compared side; faster")
        .range(0, 1e6);
    command
        .option("--regularizer", fit.weights.regularizer,
                "weight of the squared code offsets; negative: the model's setting")
        .range(-1, 1e6);
    command
        .option("--samples", options.samples,
                "samples per ray while fitting (default: the model's setting)")
        .range(2, 4096);
    command
        .option("--tolerance", fit.tolerance,
                "samples with a smaller compositing weight are left out of fit and tuning; all "
                "are evaluated again every 8 steps; 0: no sample is left out")
        .range(0, 1);
    command.flag("--refine-pose", fit.refine_pose,
                 "also optimise the pose, with a tenth of the learning rate; slower");
    command
        .option("--depth-weight", fit.weights.depth,
                "weight of the term that draws the depth of the face to that of the linear head "
                "that was fitted to the photo; with --data it needs --morphable")
        .range(0, 1e6);
    command
        .option("--identity-weight", fit.weights.identity,
                "weight of the term that keeps the person, 1 - cosine between face and photo in "
                "the model's encoder.identity_backbone")
        .range(0, 1e6);
}

void declare_tuning(Command& command, TuningOptions& tuning) {
    const std::vector<std::string> limits{"--tune", "--tune-steps"};
    command
        .option("--tune", tuning.seconds,
                "also tune the decoder to the fitted face for so many seconds; the other "
                "tools take the result, tuned.safetensors, with --tuned")
        .range(0, 86400);
    command
        .option("--tune-steps", tuning.steps,
                "end tuning after so many steps, which makes the result repeatable")
        .range(0, 1e6);
    command
        .option("--tune-learning-rate", tuning.learning_rate,
                "highest learning rate of tuning, that of the render blocks; the field's is a "
                "tenth of it. 0: by the number of steps, 0.09 for 100 and more")
        .range(0, 1)
        .needs_one_of(limits);
    command
        .option("--tune-perceptual", tuning.weights.perceptual,
                "factor on --perceptual-weight while tuning")
        .range(0, 1e6)
        .needs_one_of(limits);
    command.option("--tune-depth", tuning.weights.depth, "--depth-weight while tuning")
        .range(0, 1e6)
        .needs_one_of(limits);
    command
        .option("--tune-identity", tuning.weights.identity,
                "--identity-weight while tuning, of the face seen from a side")
        .range(0, 1e6)
        .needs_one_of(limits);
    command
        .option("--locality", tuning.weights.locality,
                "weight of the term that keeps other faces and other views as they were while "
                "tuning")
        .range(0, 1e6)
        .needs_one_of(limits);
}

}  // namespace

void declare_fit(Command& command, FitToolOptions& options) {
    declare_codes(command, options);
    declare_tuning(command, options.job.tuning);
}

namespace {

double rate_of(const FilmSummary& summary) {
    return static_cast<double>(summary.frames) / std::max(summary.seconds, 1e-9);
}

}  // namespace

void declare_video(Command& command, VideoFitOptions& options) {
    command
        .option("--frame-steps", options.steps,
                "with --video: optimiser steps of each window of frames; 0: what landmarks show")
        .range(0, 10000)
        .needs("--video");
    command
        .option("--key-steps", options.key_steps,
                "with --video: optimiser steps for identity, texture and light")
        .range(0, 10000)
        .needs("--video");
    command
        .option("--time-weight", options.time_weight,
                "with --video: weight of the term that draws the expressions of neighbouring "
                "frames together")
        .range(0, 1e6)
        .needs("--video");
    command
        .option("--video-side", options.side,
                "with --video: side of the images that are compared, one that the model renders")
        .range(64, 512)
        .needs("--video");
}

void declare_film(Command& command, FilmOptions& options) {
    command
        .option("--first-frame", options.first_frame,
                "with --video: number of the first frame that counts, from 0")
        .range(0, 1e9)
        .needs("--video");
    command
        .option("--every", options.every,
                "with --video: takes every Nth frame, so that a long film takes less time")
        .range(1, 10000)
        .needs("--video");
    command
        .option("--most-frames", options.most_frames,
                "with --video: stops after so many frames; 0: at the film's end")
        .range(0, 1e9)
        .needs("--video");
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

std::string text_of(const FilmSummary& summary) {
    return text_from(summary.frames, summary.frames == 1 ? " frame, " : " frames, ", summary.found,
                     " with the face, in ", summary.starts,
                     summary.starts == 1 ? " shot, " : " shots, ", summary.cuts,
                     summary.cuts == 1 ? " cut; " : " cuts; ", decimal(rate_of(summary), 2),
                     " frames a second");
}

JsonValue to_json(const FilmSummary& summary) {
    return JsonValue::object({{"frames", summary.frames},
                              {"found", summary.found},
                              {"held", summary.frames - summary.found},
                              {"shots", summary.starts},
                              {"cuts", summary.cuts},
                              {"seconds", summary.seconds},
                              {"frames_a_second", rate_of(summary)}});
}

}  // namespace stymo
