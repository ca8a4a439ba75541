#pragma once

#include "core/ops/index.h"
#include "nn/models/radiance_field.h"

namespace stymo {

/// The samples of face `index` that `RayPoints::significant` does not leave out, by their place in
/// (R * N).
[[nodiscard]] RowIndices significant_rows(const RayPoints& rays, std::int64_t index);

/// Compositing of one face of whose samples only some were computed: `samples` (K, 1 + width),
/// density before the features, stand at `rows` of the R * N of `deltas` (1, R, N). The others are
/// empty.
[[nodiscard]] RenderedRays composited_rows(const Variable& samples, const RowIndices& rows,
                                           const Tensor& deltas);

}  // namespace stymo
