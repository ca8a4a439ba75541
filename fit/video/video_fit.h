#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "core/io/film.h"
#include "fit/fit_job.h"
#include "fit/video/film_frame.h"

namespace stymo {

/// What a fit of frames needs besides FitJobOptions::fit, whose steps do not count.
struct VideoFitOptions {
    std::int64_t side = 128;      ///< of the compared images
    std::int64_t steps = 4;       ///< optimiser steps of each window of frames
    std::int64_t window = 8;      ///< largest number of frames that are fitted together
    double time_weight = 0.01;    ///< FitWeights::time
    std::int64_t key_frames = 6;  ///< from which identity, texture and light are fitted
    std::int64_t key_steps = 40;  ///< optimiser steps for them
    /// The part of the film that is fitted: from `first_frame` on each `every`-th frame, and at
    /// most `most_frames` of them (0: all).
    std::int64_t first_frame = 0, every = 1, most_frames = 0;
    /// Called with the name of a phase, and what of it is done, of how much (0: not known).
    std::function<void(const char*, std::int64_t, std::int64_t)> on_progress{};

    void tell(const char* phase, std::int64_t done, std::int64_t total) const {
        if (on_progress) on_progress(phase, done, total);
    }
};

struct VideoSummary {
    std::int64_t frames = 0, found = 0, cuts = 0;
    std::int64_t starts = 0;  ///< shots, counted anew where the face was gone
    double loss = 0.0;        ///< mean of FittedFrame::loss over the frames with a face
    double person_seconds = 0.0, seconds = 0.0;  ///< of the key frames, of all frames
};

/// Fits one person in a film. Identity, texture and light come from some key frames. Then windows
/// of frames are fitted one after the other: expression alone, from where the encoder sees it plus
/// what the fit of the frame before changed, with a term that draws neighbouring frames together.
/// Poses come from smoothed landmarks. Memory does not grow with the length of the film.
class VideoFit {
public:
    /// Reads the film once. `job` must outlive the object. Throws FileError for a film that cannot
    /// be read to its end or shows no face.
    VideoFit(const FitJob& job, std::filesystem::path film, VideoFitOptions options);

    /// The codes of the person, with the mean expression of the key frames.
    [[nodiscard]] const Codes& person() const { return person_; }
    /// Of the frames that are fitted.
    [[nodiscard]] double frames_per_second() const { return rate_; }
    /// Their number.
    [[nodiscard]] std::int64_t frames() const { return frames_; }
    /// Fits all frames and calls `sink` with each of them, in order. After an interrupt
    /// (core/interrupt.h) it returns early.
    VideoSummary run(const std::function<void(const FittedFrame&)>& sink) const;

private:
    void fit_person(std::vector<Face> keys);

    const FitJob& job_;
    std::filesystem::path film_;
    VideoFitOptions options_;
    Codes person_;
    double rate_ = 0.0;
    std::int64_t frames_ = 0;
    double person_seconds_ = 0.0;
};

}  // namespace stymo
