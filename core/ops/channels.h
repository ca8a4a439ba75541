#pragma once

#include "core/autograd/variable.h"

/// Directions of pixels with many channels, and how far apart they are: what perceptual distances compare.
namespace stymo {

/// x / (|x| + epsilon), the norm over the last axis. A vector of zeros has no direction: its norm counts as the constant 1, which
/// keeps the value and leaves out the derivative of a root at 0. One pass each way; `unit_channels_reference` is its oracle and
/// its path for second derivatives.
[[nodiscard]] Variable unit_channels(const Variable& x, double epsilon);
/// The same composed from square, sum, sqrt and divide.
[[nodiscard]] Variable unit_channels_reference(const Variable& x, double epsilon);
/// The mean over height and width of (a - b)^2: (batch, height, width, channels) twice -> (batch, 1, 1, channels).
[[nodiscard]] Variable mean_squared_difference(const Variable& a, const Variable& b);

}  // namespace stymo
