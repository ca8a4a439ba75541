#pragma once

#include <cstdint>

#include "core/tensor.h"

namespace stymo {

/// Vectors of `channels` numbers as mean + coefficients * directions.
struct FeatureBasis {
    Tensor mean;        ///< (channels)
    Tensor directions;  ///< (dimension, channels), orthonormal rows
};

/// The plane of `dimension` <= channels that lies closest, in the sum of squares, to the rows of
/// features (rows, channels), float32. A row counts as its weight says (rows), >= 0. The directions
/// are eigenvectors of the weighted covariance.
[[nodiscard]] FeatureBasis principal_plane(const Tensor& features, const Tensor& weights,
                                           std::int64_t dimension);

}  // namespace stymo
