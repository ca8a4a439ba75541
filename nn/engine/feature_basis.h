#pragma once

#include <cstdint>

#include "core/tensor.h"

namespace stymo {

/// An affine subspace of feature vectors: mean + coefficients * directions.
struct FeatureBasis {
    Tensor mean;        ///< (channels)
    Tensor directions;  ///< (dimension, channels), orthonormal rows
};

/// Weighted principal component analysis: the subspace of `dimension` <= channels that is closest,
/// in least squares, to the rows of `features` (rows, channels), float32. `weights` (rows), >= 0,
/// are the weights of the rows. The directions are the leading eigenvectors of the weighted
/// covariance, by increasing eigenvalue.
[[nodiscard]] FeatureBasis principal_plane(const Tensor& features, const Tensor& weights,
                                           std::int64_t dimension);

}  // namespace stymo
