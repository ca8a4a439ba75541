#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "fit/photo/landmarks.h"

namespace stymo {

/// The mean acceleration of a face's landmarks: |p(t + 1) - 2 p(t) + p(t - 1)| of all points, in
/// percent of the distance of the eyes. A face that moves evenly has 0; noise adds to it.
class LandmarkJitter {
public:
    /// The landmarks of the next frame; nothing where there is no face, or a new shot begins.
    void add(const std::optional<Landmarks>& landmarks);
    /// 0 without three frames one after the other.
    [[nodiscard]] double mean() const;

private:
    std::deque<Landmarks> last_;
    double sum_ = 0.0;
    std::int64_t count_ = 0;
};

}  // namespace stymo
