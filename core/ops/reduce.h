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

}  // namespace stymo
