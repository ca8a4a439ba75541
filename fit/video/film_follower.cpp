#include "fit/video/film_follower.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/film.h"
#include "core/tensor_eigen.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

/// The frames of a film that FilmOptions choose, one after the other. `options` must outlive it.
class FilmPart {
public:
    FilmPart(const std::filesystem::path& film, const FilmOptions& options)
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
    const FilmOptions& options_;
    std::int64_t count_ = 0, index_ = -1;
};

/// Leaves out every second one.
void thin_out(std::vector<FrameInWork>& keys) {
    std::vector<FrameInWork> kept;
    for (std::size_t i = 1; i < keys.size(); i += 2) kept.push_back(std::move(keys[i]));
    keys = std::move(kept);
}

/// The faces of up to `wanted` frames, each `stride` frames after the other, or twice as many and
/// so on if the film is longer than it says. Counts all frames if `frames` is not null.
std::vector<FrameInWork> key_frames(const PhotoPreparation& preparation, const Model& model,
                                    FilmPart film, const FilmOptions& options, bool have_masks,
                                    std::int64_t stride, std::int64_t wanted,
                                    std::int64_t* frames) {
    std::vector<FrameInWork> keys;
    for (std::int64_t i = 0;; ++i) {
        if (interrupted()) fail("interrupted; nothing was written");
        if (frames != nullptr) *frames = i;
        options.tell("reading", i, film.stated_frames());
        if (frames == nullptr && std::ssize(keys) == wanted) return keys;
        if (std::ssize(keys) == wanted && wanted > 1 && i >= 2 * film.stated_frames()) {
            thin_out(keys);
            stride *= 2;
        }
        if (std::ssize(keys) == wanted || i % stride != stride / 2) {
            if (!film.skip()) return keys;
            continue;
        }
        FrameInWork key;
        std::optional<Tensor> frame = film.next();
        if (!frame) return keys;
        key.tracked = FaceTracker(preparation.detector(), film.frames_per_second()).next(*frame);
        key.image = std::move(*frame);
        prepare_frames(preparation, model.config(), {&key, 1}, have_masks);
        if (key.tracked) keys.push_back(std::move(key));
    }
}

/// Up to `count` faces whose identities are most alike.
std::vector<FrameInWork> of_one_person(const Model& model, std::vector<FrameInWork> frames,
                                       std::int64_t count) {
    const FaceBatch batch = batch_of(model, frames, model.decoder().ladder().smallest());
    const Tensor identity = uncorrected_codes(model, batch).identity().value().to(DType::float64);
    const Eigen::Map<const RowMajorMatrix<double>> codes = matrix_map<double>(identity);
    Eigen::Index middle = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index i = 0; i < codes.rows(); ++i) {
        const double distances = (codes.rowwise() - codes.row(i)).rowwise().norm().sum();
        if (distances >= least) continue;
        least = distances;
        middle = i;
    }
    std::vector<Eigen::Index> order(frames.size());
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    std::ranges::stable_sort(order, {}, [&](Eigen::Index i) {
        return (codes.row(i) - codes.row(middle)).squaredNorm();
    });
    order.resize(std::min(order.size(), static_cast<std::size_t>(count)));
    std::vector<FrameInWork> chosen;
    for (const Eigen::Index i : order)
        chosen.push_back(std::move(frames[static_cast<std::size_t>(i)]));
    return chosen;
}

/// The frames of a window that show the face, in parts without a break.
std::vector<std::span<FrameInWork>> shots_of(std::span<FrameInWork> window) {
    std::vector<std::span<FrameInWork>> shots;
    std::size_t end = 0;
    for (std::size_t begin = 0; begin < window.size(); begin = std::max(end, begin + 1)) {
        end = begin;
        while (end < window.size() && window[end].tracked &&
               (end == begin || !window[end].frame.starts))
            ++end;
        if (end > begin) shots.push_back(window.subspan(begin, end - begin));
    }
    return shots;
}

/// Hands frames on, and repeats the one before where there is no face.
class Handing {
public:
    Handing(FilmFrame first, FilmSummary& summary,
            const std::function<void(const FilmFrame&)>& sink)
        : last_(std::move(first)), summary_(summary), sink_(sink) {}

    void take(FilmFrame frame) {
        if (frame.found) {
            ++summary_.found;
            summary_.starts += frame.starts ? 1 : 0;
            last_ = frame;
        } else {
            const std::int64_t index = frame.index;
            frame = last_;
            frame.index = index;
            frame.found = frame.starts = false;
        }
        ++summary_.frames;
        sink_(frame);
    }

private:
    FilmFrame last_;
    FilmSummary& summary_;
    const std::function<void(const FilmFrame&)>& sink_;
};

}  // namespace

FilmFollower::FilmFollower(const PhotoPreparation& preparation, const Model& model,
                           std::filesystem::path film, FilmOptions options, bool have_masks)
    : preparation_(preparation),
      model_(model),
      film_(std::move(film)),
      options_(std::move(options)),
      have_masks_(have_masks),
      expression_(preparation, model) {
    if (options_.first_frame < 0 || options_.every < 1 || options_.most_frames < 0 ||
        options_.window < 1 || options_.key_frames < 1)
        fail<ValueError>("the options of a film are out of range");
    FilmPart part(film_, options_);
    rate_ = part.frames_per_second();
    const std::int64_t wanted = 2 * options_.key_frames;
    const std::int64_t stride = std::max<std::int64_t>(1, part.stated_frames() / wanted);
    keys_ = key_frames(preparation_, model_, std::move(part), options_, have_masks_, stride, wanted,
                       &frames_);
    if (frames_ == 0)
        fail<FileError>(film_.string(), ": holds no frames",
                        options_.first_frame > 0 ? " from the first wanted one on" : "");
    // The face may be seen in a few frames alone.
    if (keys_.empty())
        keys_ = key_frames(preparation_, model_, FilmPart(film_, options_), options_, have_masks_,
                           1, 1, nullptr);
    if (keys_.empty()) fail<FileError>(film_.string(), ": no face was found");
    keys_ = of_one_person(model_, std::move(keys_), options_.key_frames);
    expression_.know(keys_);
    expression_.see(keys_);
}

FilmSummary FilmFollower::run(FilmFrame first,
                              const std::function<void(std::span<FrameInWork>)>& on_shot,
                              const std::function<void(const FilmFrame&)>& sink) const {
    const double start = seconds_now();
    FilmSummary summary;
    options_.tell("frames", 0, frames_);
    FilmPart film(film_, options_);
    FaceTracker tracker(preparation_.detector(), rate_);
    Handing handing(std::move(first), summary, sink);
    std::vector<FrameInWork> window;
    bool is_gone = true;
    const auto finish_window = [&] {
        prepare_frames(preparation_, model_.config(), window, have_masks_);
        for (FrameInWork& work : window) {
            // Also where the face before could not be prepared.
            if (work.tracked && is_gone) work.frame.starts = true;
            is_gone = !work.tracked;
        }
        for (const std::span<FrameInWork> shot : shots_of(window)) {
            expression_.see(shot);
            if (on_shot) on_shot(shot);
        }
        for (FrameInWork& work : window) {
            work.frame.found = work.tracked.has_value();
            handing.take(std::move(work.frame));
            options_.tell("frames", summary.frames, frames_);
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
    summary.seconds = seconds_now() - start;
    return summary;
}

}  // namespace stymo
