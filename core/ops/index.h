#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/autograd/variable.h"
#include "core/op_options.h"

namespace stymo {

/// The rows (axis 0) of x with these indices, which may repeat. Throws ValueError for an index
/// outside x.
[[nodiscard]] Variable gather_rows(const Variable& x, RowIndices rows);
/// Adds each row of x to the row of its index in zeros of `row_count` rows; the adjoint of
/// gather_rows. Throws ValueError for an index outside them, ShapeError unless x has one row for
/// each index.
[[nodiscard]] Variable scatter_add_rows(const Variable& x, RowIndices rows, std::int64_t row_count);

}  // namespace stymo
