#pragma once

#include "core/autograd/variable.h"

/// Normalised feature vectors and their distances, for perceptual distances.
namespace stymo {

/// x / (|x| + epsilon), with the norm over the last axis. A vector of zeros is divided by the
/// constant 1 + epsilon, which avoids the infinite derivative of the square root at 0.
/// `unit_channels_reference` is its reference implementation and provides second derivatives.
[[nodiscard]] Variable unit_channels(const Variable& x, double epsilon);
/// The same composed from square, sum, sqrt and divide.
[[nodiscard]] Variable unit_channels_reference(const Variable& x, double epsilon);
/// The mean of (a - b)^2 over height and width; a and b (batch, height, width, channels) -> (batch,
/// 1, 1, channels). Throws ShapeError for other shapes, TypeError for different element types.
[[nodiscard]] Variable mean_squared_difference(const Variable& a, const Variable& b);

}  // namespace stymo
