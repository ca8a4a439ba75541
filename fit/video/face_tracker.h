#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <tuple>
#include <vector>

#include "core/tensor.h"
#include "fit/photo/face_detector.h"
#include "fit/video/one_euro_filter.h"

namespace stymo {

/// A face in a frame of a film.
struct TrackedFace {
    Landmarks found;   ///< in pixels of the frame
    Landmarks smooth;  ///< the same without most of the detector's noise
    /// There is no frame before that shows the same face: at the beginning, after a cut, and after
    /// the face was gone.
    bool starts = false;
};

/// Follows one face through a film: at first the largest, then the one that is nearest to where it
/// was. Landmarks are smoothed by a `OneEuroFilter`, which smooths less where points move fast.
class FaceTracker {
public:
    /// `detector` must outlive the object.
    FaceTracker(const FaceDetector& detector, double frames_per_second)
        : detector_(detector), rate_(frames_per_second) {
        filters_.fill(OneEuroFilter<2>(landmark_filter));
    }

    /// The face in the next frame (height, width, 3) in [0, 1]; nothing if it is not there.
    [[nodiscard]] std::optional<TrackedFace> next(const Tensor& frame);
    /// Number of cuts so far, from a frame with the face to another one with a face.
    [[nodiscard]] std::int64_t cuts() const { return cuts_; }

private:
    /// Lengths are in units of the face's extent.
    static constexpr OneEuroSettings landmark_filter{.least_cutoff = 2.0,
                                                     .speed_factor = 12.0,
                                                     .speed_cutoff = 2.0,
                                                     .speed_from_filtered = true};

    [[nodiscard]] bool is_cut(const Tensor& frame);
    [[nodiscard]] std::optional<Landmarks> find(const Tensor& frame) const;
    [[nodiscard]] Landmarks smoothed(const Landmarks& found, bool starts);

    const FaceDetector& detector_;
    double rate_;
    std::vector<float> thumbnail_;  ///< of the frame before
    double usual_change_ = 0.0;
    std::optional<Landmarks> last_;  ///< where the face was last, unless a cut came
    std::int64_t gone_ = 0;          ///< frames since then
    std::int64_t cuts_ = 0;
    std::int64_t frames_ = 0;
    std::array<OneEuroFilter<2>, std::tuple_size_v<Landmarks>> filters_;
};

}  // namespace stymo
