#pragma once

#include "nn/models/model.h"
#include "train/data/dataset.h"
#include "train/photo_offsets.h"

namespace stymo {

/// An image with one row for each of the first few faces: target | image for the initial code |
/// three views at yaw -30, 0 and 30 degrees, at one of the model's resolutions. `offsets`: the
/// learnt offsets of the faces, or null.
[[nodiscard]] Tensor sample_sheet(const Model& model, const Dataset& faces, std::int64_t resolution,
                                  std::int64_t samples_per_ray,
                                  const PhotoOffsets* offsets = nullptr);

}  // namespace stymo
