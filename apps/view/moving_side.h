#pragma once

namespace stymo::view {

/// Decides, from the times that moving frames take, whether they are made at half their side.
class MovingSide {
public:
    /// When several frames in a row take longer than `most_milliseconds`, frames are made at half
    /// their side, until those of the whole side, four times as long at most, would be fast enough.
    explicit MovingSide(double most_milliseconds) : most_(most_milliseconds) {}

    [[nodiscard]] bool is_half() const { return is_half_; }
    /// The time of a frame at the present side, without that of making its renderer.
    void take(double milliseconds);

private:
    void change_to(bool half);

    double most_;
    bool is_half_ = false;
    /// False once frames of half the side were hardly faster: where the field takes most of the
    /// time, they only look worse.
    bool half_helps_ = true;
    int frames_ = 0;       ///< at the present side
    int slow_frames_ = 0;  ///< in a row
    double mean_ = 0.0;
    double mean_of_whole_ = 0.0;  ///< when the side was last halved
};

}  // namespace stymo::view
