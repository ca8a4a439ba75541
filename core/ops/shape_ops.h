#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// The same elements with another shape. One extent may be -1 and is then computed from the others.
[[nodiscard]] Variable reshape(const Variable& x, const Shape& shape);
[[nodiscard]] Variable reshape(const Variable& x, std::initializer_list<std::int64_t> extents);
/// Axis i of the result is axis order[i] of x.
[[nodiscard]] Variable permute(const Variable& x, const std::vector<int>& order);
/// Swaps the last two axes.
[[nodiscard]] Variable transpose(const Variable& x);
[[nodiscard]] Variable flip(const Variable& x, int axis);
/// Indices [begin, end) of `axis`.
[[nodiscard]] Variable slice(const Variable& x, int axis, std::int64_t begin, std::int64_t end);
/// Zeros before and after along `axis`.
[[nodiscard]] Variable pad(const Variable& x, int axis, std::int64_t before, std::int64_t after);
[[nodiscard]] Variable concat(const std::vector<Variable>& parts, int axis);
/// Repeats axes of extent 1 (aligned at the last axis) up to `shape`.
[[nodiscard]] Variable broadcast_to(const Variable& x, const Shape& shape);

}  // namespace stymo
