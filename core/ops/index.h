#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/autograd/variable.h"
#include "core/op_options.h"

namespace stymo {

/// Rows (axis 0) of x picked by index; an index may repeat. Throws ValueError for an index outside
/// x.
[[nodiscard]] Variable gather_rows(const Variable& x, RowIndices rows);
/// Zeros of `row_count` rows with each row of x added at its index; the adjoint of gather_rows.
[[nodiscard]] Variable scatter_add_rows(const Variable& x, RowIndices rows, std::int64_t row_count);

}  // namespace stymo
