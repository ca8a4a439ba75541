#pragma once

namespace stymo::view {

/// Decides from the times of moving frames whether they are rendered at half their side.
class MovingSide {
public:
    /// If several consecutive frames take longer than `most_milliseconds`, frames are rendered at
    /// half their side, until frames of the whole side, which take at most four times as long,
    /// would be fast enough.
    explicit MovingSide(double most_milliseconds) : most_(most_milliseconds) {}

    [[nodiscard]] bool is_half() const { return is_half_; }
    /// Adds the time of a frame at the current side, without the time for creating its renderer.
    void take(double milliseconds);

private:
    void change_to(bool half);

    double most_;
    bool is_half_ = false;
    /// False after frames of half the side turned out to be hardly faster. If the field takes most
    /// of the time, they would only look worse.
    bool half_helps_ = true;
    int frames_ = 0;       ///< number of frames at the current side
    int slow_frames_ = 0;  ///< number of consecutive slow frames
    double mean_ = 0.0;
    double mean_of_whole_ = 0.0;  ///< mean time at the whole side when the side was last halved
};

}  // namespace stymo::view
