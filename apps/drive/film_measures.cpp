#include "apps/drive/film_measures.h"

#include <algorithm>

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

}  // namespace stymo
