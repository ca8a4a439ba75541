#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/autograd/variable.h"
#include "core/op_options.h"

namespace stymo {

/// The same elements with another shape. One extent of the list may be -1 and is then computed from
/// the others. Throws ShapeError if the sizes differ.
[[nodiscard]] Variable reshape(const Variable& x, const Shape& shape);
[[nodiscard]] Variable reshape(const Variable& x, std::initializer_list<std::int64_t> extents);
/// Axis i of the result is axis order[i] of x. Throws ShapeError unless `order` is a permutation of
/// the axes.
[[nodiscard]] Variable permute(const Variable& x, const std::vector<int>& order);
/// Swaps the last two axes. Throws ShapeError for fewer axes.
[[nodiscard]] Variable transpose(const Variable& x);
[[nodiscard]] Variable flip(const Variable& x, int axis);
/// Indices [begin, end) of `axis`. Throws ShapeError if they are not within the axis.
[[nodiscard]] Variable slice(const Variable& x, int axis, std::int64_t begin, std::int64_t end);
/// Adds zeros before and after x along `axis`. Throws ShapeError for a negative number of zeros.
[[nodiscard]] Variable pad(const Variable& x, int axis, std::int64_t before, std::int64_t after);
/// Joins the parts along `axis`. Throws ShapeError if there are none or if other extents differ.
[[nodiscard]] Variable concat(const std::vector<Variable>& parts, int axis);
/// Repeats axes of extent 1 (aligned at the last axis) up to `shape`.
[[nodiscard]] Variable broadcast_to(const Variable& x, const Shape& shape);

/// The rows (axis 0) of x with these indices, which may repeat. Throws ValueError for an index
/// outside x.
[[nodiscard]] Variable gather_rows(const Variable& x, RowIndices rows);
/// Adds each row of x to the row of its index in zeros of `row_count` rows; the adjoint of
/// gather_rows. Throws ValueError for an index outside them, ShapeError unless x has one row for
/// each index.
[[nodiscard]] Variable scatter_add_rows(const Variable& x, RowIndices rows, std::int64_t row_count);

}  // namespace stymo
