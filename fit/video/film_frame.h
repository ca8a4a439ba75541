#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "fit/photo/photo_preparation.h"
#include "fit/video/face_tracker.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"

namespace stymo {

/// What is known of a frame.
struct FilmFrame {
    std::int64_t index = 0;  ///< in the film
    bool found = false;   ///< whether the frame shows the face; if not, all else is that of before
    bool starts = false;  ///< as in TrackedFace
    Tensor change{};      ///< what the expression adds to a neutral face, (1, 79)
    Codes codes{};  ///< of a fit: one row; identity, texture and light are the same in all frames
    Pose pose{};    ///< in the face's crop, like that of a photo
    double roll = 0.0;  ///< of the head in the frame, in radians: that of `pose` and of the crop
    Landmarks landmarks{};  ///< as the detector found them, in pixels of the frame
    double loss = 0.0;      ///< of a fit: photometric part of the loss at the last step
};

/// A frame with its face, as the model sees it.
struct FrameInWork {
    FilmFrame frame{};
    Tensor image{};  ///< of the film; empty after the crop is made
    std::optional<TrackedFace> tracked{};
    Face face{};
    MorphableFitTarget target{};  ///< what the linear head was fitted to
};

/// Cuts the tracked faces out and finds their masks, which may be left out, poses and landmarks. A
/// face for which that fails is not tracked afterwards.
void prepare_frames(const PhotoPreparation& preparation, const ModelConfig& model,
                    std::span<FrameInWork> frames, bool have_masks = true);
/// Prepared faces as a batch, compared at `side` pixels.
[[nodiscard]] FaceBatch batch_of(const Model& model, std::span<const FrameInWork> frames,
                                 std::int64_t side);

}  // namespace stymo
