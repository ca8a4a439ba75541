#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>

#include "core/tensor.h"
#include "fit/photo/face_detector.h"
#include "fit/video/film_follower.h"

namespace stymo {

/// The mean acceleration of a face's landmarks: |p(t + 1) - 2 p(t) + p(t - 1)| of all points, in
/// percent of the distance of the eyes. A face that moves evenly has 0; noise adds to it.
class LandmarkJitter {
public:
    /// The landmarks of the next frame; nothing where there is no face, or a new shot begins.
    void add(const std::optional<Landmarks>& landmarks);
    /// NaN without three frames one after the other.
    [[nodiscard]] double mean() const;

private:
    std::deque<Landmarks> last_;
    double sum_ = 0.0;
    std::int64_t count_ = 0;
};

/// Mean distances of landmarks in percent of the distance of the eyes.
struct LandmarkError {
    double mouth = 0.0, face = 0.0;  ///< of the points 48 to 67, and of all; NaN without frames
    std::int64_t frames = 0;         ///< that show a face in both films
};
/// Compares the frames of two films one by one, up to the end of the shorter one.
[[nodiscard]] LandmarkError landmark_error(const std::filesystem::path& film,
                                           const std::filesystem::path& truth,
                                           const FaceDetector& detector);

/// Frames of a film that was driven by another: eight of them, evenly chosen, each below the frame
/// of `film` that it follows. `frames`: the number of frames of `driven`, which are those of `film`
/// that `options` name.
[[nodiscard]] Tensor contact_sheet(const std::filesystem::path& film,
                                   const std::filesystem::path& driven, std::int64_t frames,
                                   const FilmOptions& options);

}  // namespace stymo
