#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

#include "fit/fit_job.h"
#include "fit/video/film_follower.h"

namespace stymo {

/// What a fit of frames needs besides FitJobOptions::fit, whose steps do not count.
struct VideoFitOptions {
    std::int64_t side = 128;      ///< of the compared images
    std::int64_t steps = 4;       ///< optimiser steps of each window of frames
    double time_weight = 0.01;    ///< FitWeights::time
    std::int64_t key_steps = 40;  ///< optimiser steps for the person, to all key frames
};

struct VideoSummary {
    FilmSummary film{};
    /// Mean of FilmFrame::loss over the frames with a face; nothing without steps or such frames.
    std::optional<double> loss{};
    double person_seconds = 0.0;  ///< of the fit to the key frames
};

/// Fits one person in a film. Identity, texture and light come from the key frames. Then windows of
/// frames are fitted one after the other: expression alone, from what the landmarks show plus what
/// the fit of the frame before changed, with a term that draws neighbouring frames together. Poses
/// come from the landmarks.
class VideoFit {
public:
    /// `job` must outlive the object. Throws what FilmFollower throws.
    VideoFit(const FitJob& job, const std::filesystem::path& film, FilmOptions frames,
             VideoFitOptions options);

    [[nodiscard]] double frames_per_second() const { return follower_.frames_per_second(); }
    /// Fits all frames and calls `sink` with each of them, as FilmFollower::run does.
    VideoSummary run(const std::function<void(const FilmFrame&)>& sink) const;

private:
    void fit_person();

    const FitJob& job_;
    VideoFitOptions options_;
    FilmFollower follower_;
    Codes person_;
    Tensor rest_;  ///< mean FilmFrame::change of the key frames, (1, 79)
    double person_seconds_ = 0.0;
};

}  // namespace stymo
