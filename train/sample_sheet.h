#pragma once

#include "nn/models/model.h"
#include "train/code_offsets.h"
#include "train/data/dataset.h"

namespace stymo {

/// One row for each of the first few faces: target | initial | three views at yaw -30, 0 and 30
/// degrees, at a resolution of the model. `offsets`: the learnt offsets of the faces' codes, or
/// null.
[[nodiscard]] Tensor sample_sheet(const Model& model, const Dataset& faces, std::int64_t resolution,
                                  std::int64_t samples_per_ray,
                                  const CodeOffsets* offsets = nullptr);

}  // namespace stymo
