#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "core/io/film.h"
#include "fit/fit_job.h"
#include "fit/video/face_tracker.h"

namespace stymo {

/// What a fit of frames needs besides FitJobOptions::fit, whose steps do not count.
struct VideoFitOptions {
    std::int64_t side = 128;      ///< of the compared images
    std::int64_t steps = 4;       ///< optimiser steps of each window of frames
    std::int64_t window = 8;      ///< largest number of frames that are fitted together
    double time_weight = 0.01;    ///< FitWeights::time
    std::int64_t key_frames = 6;  ///< from which identity, texture and light are fitted
    std::int64_t key_steps = 40;  ///< optimiser steps for them
};

/// The fit of a frame.
struct FittedFrame {
    std::int64_t index = 0;
    bool found = false;   ///< whether the frame shows the face; if not, all else is that of before
    bool starts = false;  ///< as in TrackedFace
    Codes codes;          ///< one row; identity, texture and light are the same in all frames
    Pose pose;            ///< in the face's crop, like that of a photo
    double roll = 0.0;    ///< of the head in the frame, in radians: that of `pose` and of the crop
    Landmarks landmarks{};  ///< as the detector found them, in pixels of the frame
    double loss = 0.0;      ///< photometric part of the loss at the last step
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
    [[nodiscard]] double frames_per_second() const { return rate_; }
    /// Number of frames.
    [[nodiscard]] std::int64_t frames() const { return frames_; }
    /// Fits all frames and calls `sink` with each of them, in order. After an interrupt
    /// (core/interrupt.h) it returns early.
    VideoSummary run(const std::function<void(const FittedFrame&)>& sink) const;

private:
    /// Counts the frames, and prepares the faces of up to `wanted` of them, each `stride` frames
    /// after the other.
    std::vector<Face> key_faces(FilmReader& reader, const FaceDetector& detector,
                                std::int64_t stride, std::int64_t wanted);
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
