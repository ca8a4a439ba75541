#include "fit/video/video_fit.h"

#include <algorithm>
#include <span>
#include <utility>

#include "core/clock.h"
#include "core/ops/ops.h"
#include "fit/expression_prior.h"

namespace stymo {

namespace {

constexpr std::size_t expression_group = 1;

/// Cheaper than in the fit of a photo, and hardly different at the sides of films.
constexpr std::int64_t samples_of_a_frame = 16;
constexpr double tolerance_of_a_frame = 0.01;
/// Of the first step in each window, in standard deviations (expression_directions).
constexpr double learning_rate_of_a_frame = 0.3;
/// Share of what fits have added to an expression that the next window starts with.
constexpr double kept_correction = 0.9;

/// Each group is the mean over the rows.
Codes mean_of(Codes codes) {
    for (Variable& group : codes.groups) group = mean(group, {0}).detach();
    return codes;
}

/// Fits consecutive frames and remembers what the next ones start from.
class FrameFits {
public:
    /// `rest`: FilmFrame::change where the person has their own expression, (1, 79).
    FrameFits(const FitJob& job, const VideoFitOptions& options, const Codes& person,
              const Tensor& rest)
        : job_(job),
          options_(options),
          person_(person),
          rest_(rest),
          directions_(expression_directions(job.model())) {}

    /// `frames` show the face one after the other.
    void fit(std::span<FrameInWork> frames) {
        const FaceBatch batch = batch_of(job_.model(), frames, options_.side);
        const auto rows = std::ssize(frames);
        if (frames.front().frame.starts) before_ = correction_ = {};
        std::vector<Variable> changes;
        for (const FrameInWork& frame : frames) changes.emplace_back(frame.frame.change);
        const Variable seen = person_.expression() + concat(changes, 0) - Variable(rest_);
        Codes start;
        for (std::size_t group = 0; group < start.groups.size(); ++group) {
            const Variable& own = person_.groups[group];
            start.groups[group] = broadcast_to(own, {rows, own.shape(1)}).detach();
        }
        start.groups[expression_group] =
            (correction_.defined() ? seen + Variable(correction_) : seen).detach();
        FitOptions fit = job_.options().fit;
        fit.initial = start;
        fit.end_losses = false;
        if (fit.samples_per_ray == 0) fit.samples_per_ray = samples_of_a_frame;
        fit.tolerance = std::max(fit.tolerance, tolerance_of_a_frame);
        fit.steps = options_.steps;
        if (directions_.defined()) fit.learning_rate = learning_rate_of_a_frame;
        fit.fitted_groups = {false, true, false, false};
        fit.expression_directions = directions_;
        fit.weights.depth = 0.0;
        fit.weights.time = options_.time_weight;
        fit.expression_before = before_;
        const FitResult result = job_.fit_frames(batch, fit);
        const Variable& fitted = result.fitted.expression();
        const Variable last = slice(fitted, 0, rows - 1, rows);
        before_ = last.value();
        correction_ = (mean(fitted - seen, {0}) * kept_correction).value();
        for (std::int64_t i = 0; i < rows; ++i) {
            FilmFrame& frame = frames[static_cast<std::size_t>(i)].frame;
            frame.codes = codes_of_face(result.fitted, i);
            const double roll_of_crop = frame.roll - frame.pose.roll;
            frame.pose = pose_from_camera(result.cameras[static_cast<std::size_t>(i)]);
            frame.roll = frame.pose.roll + roll_of_crop;
            for (const auto& [name, value] : result.terms)
                if (name == "photometric") frame.loss = value;
        }
    }

private:
    const FitJob& job_;
    const VideoFitOptions& options_;
    const Codes& person_;
    Tensor rest_, directions_;
    Tensor before_;      ///< expression of the frame before, (1, 79); undefined at a start
    Tensor correction_;  ///< what fits add to the expression that landmarks show, (1, 79)
};

/// With a side that the model renders. Throws for another one that is not larger than the model's.
VideoFitOptions rendered_by(const Model& model, VideoFitOptions options) {
    options.side = std::min(options.side, model.config().decoder.resolution);
    static_cast<void>(model.decoder().ladder().count_up_to(options.side));
    return options;
}

}  // namespace

VideoFit::VideoFit(const FitJob& job, const std::filesystem::path& film, FilmOptions frames,
                   VideoFitOptions options)
    : job_(job),
      options_(rendered_by(job.model(), options)),
      follower_(job.preparation(), job.model(), film, std::move(frames), true) {
    const double start = seconds_now();
    fit_person();
    person_seconds_ = seconds_now() - start;
}

void VideoFit::fit_person() {
    const std::vector<FrameInWork>& keys = follower_.keys();
    FitOptions fit = job_.options().fit;
    fit.steps = options_.key_steps;
    fit.one_person = keys.size() > 1;
    fit.expression_directions = expression_directions(job_.model());
    fit.end_losses = false;
    fit.weights.depth = 0.0;
    follower_.options().tell("person", 0, options_.key_steps);
    fit.on_step = [this](const FitStep& step) {
        follower_.options().tell("person", step.steps, options_.key_steps);
    };
    person_ = mean_of(job_.fit_frames(batch_of(job_.model(), keys, options_.side), fit).fitted);
    std::vector<Variable> changes;
    for (const FrameInWork& key : keys) changes.emplace_back(key.frame.change);
    rest_ = mean(concat(changes, 0), {0}).value();
}

VideoSummary VideoFit::run(const std::function<void(const FilmFrame&)>& sink) const {
    VideoSummary summary{.person_seconds = person_seconds_};
    double losses = 0.0;
    FrameFits fits(job_, options_, person_, rest_);
    const FilmFrame first{.codes = person_, .pose = frontal_pose(job_.model().config().camera)};
    summary.film = follower_.run(
        first, [&](std::span<FrameInWork> shot) { fits.fit(shot); },
        [&](const FilmFrame& frame) {
            if (frame.found) losses += frame.loss;
            sink(frame);
        });
    if (options_.steps > 0 && summary.film.found > 0)
        summary.loss = losses / static_cast<double>(summary.film.found);
    return summary;
}

}  // namespace stymo
