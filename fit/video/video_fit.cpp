#include "fit/video/video_fit.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "core/tensor_eigen.h"
#include "fit/expression_prior.h"
#include "nn/realtime/view.h"

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

FaceBatch batch_of(const FitJob& job, std::span<const FrameInWork> frames, std::int64_t side) {
    std::vector<Face> faces;
    for (const FrameInWork& frame : frames) faces.push_back(frame.face);
    return make_batch(faces, job.model().decoder().ladder().smallest(), side);
}

/// The frames of a film that VideoFitOptions chooses, one after the other.
class FilmPart {
public:
    FilmPart(const std::filesystem::path& film, const VideoFitOptions& options)
        : reader_(film), options_(options) {}

    [[nodiscard]] double frames_per_second() const {
        return reader_.frames_per_second() / static_cast<double>(options_.every);
    }
    /// As FilmReader::stated_frames.
    [[nodiscard]] std::int64_t stated_frames() const {
        const std::int64_t rest = reader_.stated_frames() - options_.first_frame;
        const std::int64_t frames =
            std::max<std::int64_t>(0, rest + options_.every - 1) / options_.every;
        return options_.most_frames > 0 ? std::min(frames, options_.most_frames) : frames;
    }
    [[nodiscard]] std::optional<Tensor> next() {
        return advance() ? reader_.next() : std::optional<Tensor>();
    }
    [[nodiscard]] bool skip() { return advance() && reader_.skip(); }
    /// Number of the last frame in the film.
    [[nodiscard]] std::int64_t index() const { return index_; }

private:
    [[nodiscard]] bool advance() {
        if (options_.most_frames > 0 && count_ == options_.most_frames) return false;
        const std::int64_t passed = count_ == 0 ? options_.first_frame : options_.every - 1;
        for (std::int64_t i = 0; i < passed; ++i)
            if (!reader_.skip()) return false;
        index_ += passed + 1;
        ++count_;
        return true;
    }

    FilmReader reader_;
    const VideoFitOptions& options_;
    std::int64_t count_ = 0, index_ = -1;
};

/// The faces of up to `wanted` frames, each `stride` frames after the other. Counts all frames if
/// `frames` is not null.
std::vector<Face> key_faces(const FitJob& job, FilmPart film, const VideoFitOptions& options,
                            std::int64_t stride, std::int64_t wanted, std::int64_t* frames) {
    std::vector<Face> keys;
    for (std::int64_t i = 0;; ++i) {
        if (interrupted()) fail("interrupted; nothing was written");
        if (frames != nullptr) *frames = i;
        options.tell("reading", i, film.stated_frames());
        if (std::ssize(keys) == wanted || i % stride != stride / 2) {
            if (!film.skip()) return keys;
            continue;
        }
        FrameInWork key;
        std::optional<Tensor> frame = film.next();
        if (!frame) return keys;
        key.tracked =
            FaceTracker(job.preparation().detector(), film.frames_per_second()).next(*frame);
        key.image = std::move(*frame);
        prepare_frames(job.preparation(), job.model().config(), {&key, 1});
        if (key.tracked) keys.push_back(std::move(key.face));
    }
}

/// Each group is the mean over the rows.
Codes mean_of(Codes codes) {
    for (Variable& group : codes.groups) group = mean(group, {0}).detach();
    return codes;
}

/// Up to `count` faces that look most alike to the encoder: after a cut a film may show somebody
/// else.
std::vector<Face> of_one_person(const Model& model, const std::vector<Face>& faces,
                                std::size_t count) {
    const FaceBatch batch = make_batch(faces, model.decoder().ladder().smallest());
    const Tensor identity = face_codes(model, batch).identity().value().to(DType::float64);
    const Eigen::Map<const RowMajorMatrix<double>> codes = matrix_map<double>(identity);
    Eigen::Index middle = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index i = 0; i < codes.rows(); ++i) {
        const double distances = (codes.rowwise() - codes.row(i)).rowwise().norm().sum();
        if (distances >= least) continue;
        least = distances;
        middle = i;
    }
    std::vector<Eigen::Index> order(faces.size());
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    std::ranges::stable_sort(order, {}, [&](Eigen::Index i) {
        return (codes.row(i) - codes.row(middle)).squaredNorm();
    });
    order.resize(std::min(order.size(), count));
    std::vector<Face> chosen;
    for (const Eigen::Index i : order) chosen.push_back(faces[static_cast<std::size_t>(i)]);
    return chosen;
}

/// Fits consecutive frames and remembers what the next ones start from.
class FrameFits {
public:
    FrameFits(const FitJob& job, const VideoFitOptions& options, const Codes& person)
        : job_(job),
          options_(options),
          person_(person),
          directions_(expression_directions(job.model())) {}

    /// `frames` show the face one after the other.
    void fit(std::span<FrameInWork> frames) {
        const FaceBatch batch = batch_of(job_, frames, options_.side);
        const auto rows = std::ssize(frames);
        if (frames.front().frame.starts) before_ = correction_ = {};
        const Variable seen = face_codes(job_.model(), batch).expression();
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
            FittedFrame& frame = frames[static_cast<std::size_t>(i)].frame;
            frame.found = true;
            frame.codes = codes_of_face(result.fitted, i);
            frame.pose = pose_from_camera(result.cameras[static_cast<std::size_t>(i)]);
            for (const auto& [name, value] : result.terms)
                if (name == "photometric") frame.loss = value;
        }
    }

private:
    const FitJob& job_;
    const VideoFitOptions& options_;
    const Codes& person_;
    Tensor directions_;
    Tensor before_;      ///< expression of the frame before, (1, 79); undefined at a start
    Tensor correction_;  ///< what fits add to the expression that the encoder sees, (1, 79)
};

}  // namespace

VideoFit::VideoFit(const FitJob& job, std::filesystem::path film, VideoFitOptions options)
    : job_(job), film_(std::move(film)), options_(std::move(options)) {
    const double start = seconds_now();
    options_.side = std::min(options_.side, job_.model().config().decoder.resolution);
    // Throws for a side that the model does not render.
    static_cast<void>(job_.model().decoder().ladder().count_up_to(options_.side));
    FilmPart part(film_, options_);
    rate_ = part.frames_per_second();
    const std::int64_t wanted = 2 * options_.key_frames;
    const std::int64_t stride = std::max<std::int64_t>(1, part.stated_frames() / wanted);
    std::vector<Face> keys = key_faces(job_, std::move(part), options_, stride, wanted, &frames_);
    if (frames_ == 0)
        fail<FileError>(film_.string(), ": holds no frames",
                        options_.first_frame > 0 ? " from the first wanted one on" : "");
    // The face may be seen in a few frames alone.
    if (keys.empty()) keys = key_faces(job_, FilmPart(film_, options_), options_, 1, 1, nullptr);
    if (keys.empty()) fail<FileError>(film_.string(), ": no face was found");
    fit_person(std::move(keys));
    person_seconds_ = seconds_now() - start;
}

void VideoFit::fit_person(std::vector<Face> keys) {
    keys = of_one_person(job_.model(), keys, static_cast<std::size_t>(options_.key_frames));
    FitOptions fit = job_.options().fit;
    fit.steps = options_.key_steps;
    fit.one_person = keys.size() > 1;
    fit.expression_directions = expression_directions(job_.model());
    fit.end_losses = false;
    fit.weights.depth = 0.0;
    options_.tell("person", 0, options_.key_steps);
    fit.on_step = [this](const FitStep& step) {
        options_.tell("person", step.steps, options_.key_steps);
    };
    const FaceBatch batch =
        make_batch(keys, job_.model().decoder().ladder().smallest(), options_.side);
    person_ = mean_of(job_.fit_frames(batch, fit).fitted);
}

VideoSummary VideoFit::run(const std::function<void(const FittedFrame&)>& sink) const {
    const double start = seconds_now();
    VideoSummary summary{.person_seconds = person_seconds_};
    options_.tell("frames", 0, frames_);
    FilmPart film(film_, options_);
    FaceTracker tracker(job_.preparation().detector(), rate_);
    FrameFits fits(job_, options_, person_);
    FittedFrame last{.codes = person_, .pose = frontal_pose(job_.model().config().camera)};
    std::vector<FrameInWork> window;
    // Fits the frames from `begin` on that show the face without a break; returns their number.
    const auto fit_run = [&](std::size_t begin) {
        std::size_t end = begin;
        while (end < window.size() && window[end].tracked &&
               (end == begin || !window[end].frame.starts))
            ++end;
        if (end > begin) fits.fit(std::span(window).subspan(begin, end - begin));
        return end - begin;
    };
    const auto finish_window = [&] {
        prepare_frames(job_.preparation(), job_.model().config(), window);
        // Where a face could not be prepared, the next one starts anew.
        for (std::size_t i = 1; i < window.size(); ++i)
            if (!window[i - 1].tracked) window[i].frame.starts = true;
        for (std::size_t i = 0; i < window.size();) i += std::max<std::size_t>(1, fit_run(i));
        for (FrameInWork& work : window) {
            FittedFrame& frame = work.frame;
            if (frame.found) {
                ++summary.found;
                summary.starts += frame.starts ? 1 : 0;
                summary.loss += frame.loss;
                last = frame;
            } else {
                const std::int64_t index = frame.index;
                frame = last;
                frame.index = index;
                frame.found = frame.starts = false;
            }
            sink(frame);
            options_.tell("frames", ++summary.frames, frames_);
        }
        window.clear();
    };
    while (!interrupted()) {
        std::optional<Tensor> image = film.next();
        if (!image) break;
        FrameInWork work;
        work.frame.index = film.index();
        work.tracked = tracker.next(*image);
        work.frame.starts = work.tracked && work.tracked->starts;
        if (work.tracked) work.image = std::move(*image);
        window.push_back(std::move(work));
        if (std::ssize(window) == options_.window) finish_window();
    }
    if (!interrupted()) finish_window();
    summary.cuts = tracker.cuts();
    summary.loss /= static_cast<double>(std::max<std::int64_t>(1, summary.found));
    summary.seconds = seconds_now() - start;
    return summary;
}

}  // namespace stymo
