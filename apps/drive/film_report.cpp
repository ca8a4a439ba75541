#include "apps/drive/film_report.h"

#include <algorithm>
#include <iterator>
#include <vector>

#include "core/io/film.h"
#include "core/io/image.h"
#include "core/ops/shape_ops.h"

namespace stymo {

void LandmarkJitter::add(const std::optional<Landmarks>& landmarks) {
    if (!landmarks) return last_.clear();
    last_.push_back(*landmarks);
    if (last_.size() < 3) return;
    double sum = 0.0;
    for (std::size_t i = 0; i < landmarks->size(); ++i)
        sum += (last_[2][i] - 2.0 * last_[1][i] + last_[0][i]).norm();
    sum_ += 100.0 * sum / static_cast<double>(landmarks->size()) / inter_ocular_distance(last_[1]);
    ++count_;
    last_.pop_front();
}

double LandmarkJitter::mean() const {
    return sum_ / static_cast<double>(count_);
}

LandmarkError landmark_error(const std::filesystem::path& film, const std::filesystem::path& truth,
                             const FaceDetector& detector) {
    FilmReader one(film), other(truth);
    LandmarkError error;
    for (;;) {
        const std::optional<Tensor> a = one.next(), b = other.next();
        if (!a || !b) break;
        const std::vector<DetectedFace> seen = detector.find(*a, FaceSearch::quick),
                                        wanted = detector.find(*b, FaceSearch::quick);
        if (seen.empty() || wanted.empty()) continue;
        const Landmarks &found = seen.front().landmarks, &right = wanted.front().landmarks;
        const auto distance = [&](std::size_t first) {
            double sum = 0.0;
            for (std::size_t i = first; i < right.size(); ++i) sum += (found[i] - right[i]).norm();
            return 100.0 * sum / static_cast<double>(right.size() - first) /
                   inter_ocular_distance(right);
        };
        constexpr std::size_t mouth = 48;
        error.mouth += distance(mouth);
        error.face += distance(0);
        ++error.frames;
    }
    error.mouth /= static_cast<double>(error.frames);
    error.face /= static_cast<double>(error.frames);
    return error;
}

namespace {

constexpr std::int64_t height = 256, columns = 8;

/// The frames with these numbers, which ascend.
std::vector<Tensor> frames_of(const std::filesystem::path& film,
                              const std::vector<std::int64_t>& numbers) {
    FilmReader reader(film);
    std::vector<Tensor> frames;
    std::int64_t next = 0;
    for (const std::int64_t number : numbers) {
        while (next < number && reader.skip()) ++next;
        const std::optional<Tensor> frame = reader.next();
        if (!frame) break;
        ++next;
        const std::int64_t width =
            std::max<std::int64_t>(1, height * frame->shape(1) / frame->shape(0));
        frames.push_back(resize_image(*frame, height, static_cast<int>(width)));
    }
    return frames;
}

}  // namespace

Tensor contact_sheet(const std::filesystem::path& film, const std::filesystem::path& driven,
                     std::int64_t frames, const FilmOptions& options) {
    std::vector<std::int64_t> below, above;
    for (std::int64_t i = 0; i < std::min(columns, frames); ++i) {
        below.push_back((2 * i + 1) * frames / (2 * std::min(columns, frames)));
        above.push_back(options.first_frame + options.every * below.back());
    }
    std::vector<Tensor> tiles = frames_of(film, above), answers = frames_of(driven, below);
    // A film may end a few frames before the number that it states.
    const std::size_t pairs = std::min(tiles.size(), answers.size());
    tiles.resize(pairs);
    answers.resize(pairs);
    std::ranges::move(answers, std::back_inserter(tiles));
    std::int64_t width = 0;
    for (const Tensor& tile : tiles) width = std::max(width, tile.shape(1));
    for (Tensor& tile : tiles) {
        const std::int64_t missing = width - tile.shape(1);
        tile = pad(tile, 1, missing / 2, missing - missing / 2).value();
    }
    return tile_images(tiles, static_cast<int>(pairs));
}

}  // namespace stymo
