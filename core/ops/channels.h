#pragma once

#include "core/autograd/variable.h"

/// Normalised feature vectors and their distances, as perceptual distances use them.
namespace stymo {

/// x / (|x| + epsilon), the norm over the last axis. For a vector of zeros the norm is the constant
/// 1, which keeps the value and avoids the derivative of a square root at 0.
/// `unit_channels_reference` is its reference implementation and provides second derivatives.
[[nodiscard]] Variable unit_channels(const Variable& x, double epsilon);
/// The same composed from square, sum, sqrt and divide.
[[nodiscard]] Variable unit_channels_reference(const Variable& x, double epsilon);
/// The mean over height and width of (a - b)^2: (batch, height, width, channels) twice -> (batch,
/// 1, 1, channels).
[[nodiscard]] Variable mean_squared_difference(const Variable& a, const Variable& b);

}  // namespace stymo
