#include "apps/view/moving_side.h"

namespace stymo::view {

void MovingSide::take(double milliseconds) {
    constexpr double memory = 0.8;            // of the mean
    constexpr double whole_of_half = 4.0;     // the time of a whole frame in times of a half one
    constexpr double share_that_helps = 0.7;  // of the whole frame's time
    constexpr int frames_to_judge = 8;
    mean_ = frames_ == 0 ? milliseconds : memory * mean_ + (1.0 - memory) * milliseconds;
    ++frames_;
    slow_frames_ = milliseconds > most_ ? slow_frames_ + 1 : 0;
    if (frames_ < frames_to_judge) return;
    if (!is_half_) {
        if (half_helps_ && slow_frames_ >= frames_to_judge) {
            mean_of_whole_ = mean_;
            change_to(true);
        }
    } else if (mean_ > share_that_helps * mean_of_whole_) {
        half_helps_ = false;
        change_to(false);
    } else if (whole_of_half * mean_ < most_) {
        change_to(false);
    }
}

void MovingSide::change_to(bool half) {
    is_half_ = half;
    frames_ = 0;
    slow_frames_ = 0;
}

}  // namespace stymo::view
