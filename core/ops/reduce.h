#pragma once

#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// Sum of all elements, a scalar.
[[nodiscard]] Variable sum(const Variable& x);
/// Sum over the given axes, kept with extent 1. Throws ShapeError if an axis is given twice.
[[nodiscard]] Variable sum(const Variable& x, const std::vector<int>& axes);
[[nodiscard]] Variable mean(const Variable& x);
[[nodiscard]] Variable mean(const Variable& x, const std::vector<int>& axes);
/// Sums a broadcast value back to `shape`; the adjoint of broadcast_to. Throws ShapeError unless
/// `shape` broadcasts to that of x.
[[nodiscard]] Variable sum_to(const Variable& x, const Shape& shape);
/// Running sum along `axis`: inclusive (x_0, x_0+x_1, ...) or exclusive (0, x_0, ...).
[[nodiscard]] Variable cumsum(const Variable& x, int axis, bool exclusive = false);

// Normalised feature vectors and their distances, for perceptual distances.

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
