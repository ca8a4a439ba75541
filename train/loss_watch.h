#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace stymo {

/// Notices a loss that explodes while it is still finite, as with a learning rate that is too high.
/// A loss is high if it is above `factor` times the lowest loss of the phase, where losses below
/// `least` count as `least`: images alone cannot differ by so much. High losses of `most` steps in
/// a row, or of the last step of a run, end the run.
class LossWatch {
public:
    static constexpr double factor = 1000.0, least = 0.01;
    static constexpr std::int64_t most = 10;

    /// The finite loss of one more step.
    void add(double loss) {
        lowest_ = std::min(lowest_, std::max(loss, least));
        high_steps_ = loss > factor * lowest_ ? high_steps_ + 1 : 0;
    }
    [[nodiscard]] double lowest() const { return lowest_; }
    [[nodiscard]] std::int64_t high_steps() const { return high_steps_; }

private:
    double lowest_ = std::numeric_limits<double>::infinity();
    std::int64_t high_steps_ = 0;
};

}  // namespace stymo
