#include "apps/drive/film_measures.h"

#include <algorithm>
#include <vector>

#include "core/io/film.h"

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
    return sum_ / static_cast<double>(std::max<std::int64_t>(1, count_));
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
    const double count = static_cast<double>(std::max<std::int64_t>(1, error.frames));
    error.mouth /= count;
    error.face /= count;
    return error;
}

}  // namespace stymo
