#include "apps/view/moving_side.h"

namespace stymo::view {

void MovingSide::take(double milliseconds) {
    constexpr double memory = 0.8;  // weight of the earlier mean in the moving mean
    // Time of a frame at the whole side, in units of that at half the side.
    constexpr double whole_of_half = 4.0;
    // Half the side helps if its frames take less than this share of the time.
    constexpr double share_that_helps = 0.7;
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
