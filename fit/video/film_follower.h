#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "fit/video/film_frame.h"
#include "fit/video/landmark_expression.h"

namespace stymo {

/// Which frames of a film count, and how they are followed.
struct FilmOptions {
    /// From `first_frame` on (at least 0) each `every`-th frame (at least 1), and at most
    /// `most_frames` of them (0: all).
    std::int64_t first_frame = 0, every = 1, most_frames = 0;
    std::int64_t window = 8;      ///< largest number of frames that are prepared together, from 1
    std::int64_t key_frames = 6;  ///< from which the person is known, at least 1
    /// Called with the name of a phase, and what of it is done, of how much (0: not known).
    std::function<void(const char*, std::int64_t, std::int64_t)> on_progress{};

    void tell(const char* phase, std::int64_t done, std::int64_t total) const {
        if (on_progress) on_progress(phase, done, total);
    }
};

struct FilmSummary {
    std::int64_t frames = 0, found = 0, cuts = 0;
    std::int64_t starts = 0;  ///< shots, counted anew where the face was gone
    double seconds = 0.0;     ///< of all frames
};

/// Follows one person through a film: pose and expression of each frame, from smoothed landmarks.
/// Memory does not grow with the length of the film.
class FilmFollower {
public:
    /// Reads the film once, for key frames that show the person. `preparation` has the
    /// `settings_for` the model; both must outlive the object. `have_masks`:
    /// as in prepare_frames. Throws ValueError for options out of range and FileError for a film
    /// that cannot be read to its end or shows no face.
    FilmFollower(const PhotoPreparation& preparation, const Model& model,
                 std::filesystem::path film, FilmOptions options, bool have_masks);

    [[nodiscard]] const FilmOptions& options() const { return options_; }
    /// Up to FilmOptions::key_frames frames with the face, those whose identities
    /// (uncorrected_codes) are most alike: after a cut a film may show somebody else.
    [[nodiscard]] const std::vector<FrameInWork>& keys() const { return keys_; }
    /// Of the frames that count.
    [[nodiscard]] double frames_per_second() const { return rate_; }
    /// Their number.
    [[nodiscard]] std::int64_t frames() const { return frames_; }

    /// Follows all frames and calls `sink` with each of them, in order. Frames that show the face
    /// without a break are handed to `on_shot` before, at most a window of them at once. Frames
    /// without the face repeat the one before; those at the beginning repeat `first`. After an
    /// interrupt (core/interrupt.h) it returns early.
    FilmSummary run(FilmFrame first, const std::function<void(std::span<FrameInWork>)>& on_shot,
                    const std::function<void(const FilmFrame&)>& sink) const;

private:
    const PhotoPreparation& preparation_;
    const Model& model_;
    std::filesystem::path film_;
    FilmOptions options_;
    bool have_masks_;
    LandmarkExpression expression_;
    std::vector<FrameInWork> keys_;
    double rate_ = 0.0;
    std::int64_t frames_ = 0;
};

}  // namespace stymo
