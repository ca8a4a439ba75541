#pragma once

#include "nn/models/model.h"
#include "train/dataset.h"
#include "train/face_codes.h"

namespace stymo {

/// One row for each of the first few faces: target | initial | three views at yaw -30, 0 and 30 degrees, at a resolution
/// of the model. `offsets`: of the faces' codes, if they learnt any.
[[nodiscard]] Tensor sample_sheet(const Model& model, const Dataset& faces, std::int64_t resolution, std::int64_t samples_per_ray,
                                  const CodeOffsets* offsets = nullptr);

}  // namespace stymo
