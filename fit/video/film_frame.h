#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "fit/photo/photo_preparation.h"
#include "fit/video/face_tracker.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"

namespace stymo {

/// The fit of a frame.
struct FittedFrame {
    std::int64_t index = 0;  ///< in the film
    bool found = false;   ///< whether the frame shows the face; if not, all else is that of before
    bool starts = false;  ///< as in TrackedFace
    Codes codes;          ///< one row; identity, texture and light are the same in all frames
    Pose pose;            ///< in the face's crop, like that of a photo
    double roll = 0.0;    ///< of the head in the frame, in radians: that of `pose` and of the crop
    Landmarks landmarks{};  ///< as the detector found them, in pixels of the frame
    double loss = 0.0;      ///< photometric part of the loss at the last step
};

/// A frame with its face, as the model sees it.
struct FrameInWork {
    FittedFrame frame{};
    Tensor image{};  ///< of the film; empty after the crop is made
    std::optional<TrackedFace> tracked{};
    Face face{};
};

/// Cuts the tracked faces out and finds their masks, which may be left out, poses and landmarks. A
/// face for which that fails is not tracked afterwards.
void prepare_frames(const PhotoPreparation& preparation, const ModelConfig& model,
                    std::span<FrameInWork> frames, bool have_masks = true);

}  // namespace stymo
