#pragma once

#include "core/ops/shape_ops.h"
#include "nn/models/radiance_field.h"

namespace stymo {

/// DecodeOptions::significant_samples: 1 for every sample whose compositing weight is at least the
/// tolerance, 0 for the others.
[[nodiscard]] Tensor significant_samples(const Tensor& weights, double tolerance);

/// Indices into R * N of the samples of face `index` that `RayPoints::significant` does not leave
/// out.
[[nodiscard]] RowIndices significant_rows(const RayPoints& rays, std::int64_t index);

/// Composites the rays of one face if only some samples were computed. `samples` (K, 1 + width)
/// holds density, then features, of the samples `rows` among the R * N samples of `deltas` (1, R,
/// N). The other samples are empty.
[[nodiscard]] RenderedRays composited_rows(const Variable& samples, const RowIndices& rows,
                                           const Tensor& deltas);

}  // namespace stymo
