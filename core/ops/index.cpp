#include "core/ops/index.h"

#include "core/autograd/record.h"
#include "core/error.h"
#include "core/kernels/index.h"

namespace stymo {

namespace {

void check_rows(const char* name, const RowIndices& rows, std::int64_t row_count) {
    for (const std::int64_t row : rows) {
        if (row < 0 || row >= row_count)
            fail<ValueError>("[", name, "] row ", row, " of ", row_count);
    }
}

}  // namespace

Variable gather_rows(const Variable& x, RowIndices rows) {
    check_rows("gather_rows", rows, x.shape(0));
    Tensor value = kernels::gather_rows(x.value(), rows);
    return record("gather_rows", std::move(value), {x}, Save::none(),
                  {[rows = std::move(rows)](const Vjp& v) {
                      return scatter_add_rows(v.grad(), rows, v.shape(0)[0]);
                  }});
}

Variable scatter_add_rows(const Variable& x, RowIndices rows, std::int64_t row_count) {
    check_rows("scatter_add_rows", rows, row_count);
    if (x.shape(0) != static_cast<std::int64_t>(rows.size()))
        fail<ShapeError>("[scatter_add_rows] ", rows.size(), " indices for ", x.shape());
    Tensor value = kernels::scatter_add_rows(x.value(), rows, row_count);
    return record("scatter_add_rows", std::move(value), {x}, Save::none(),
                  {[rows = std::move(rows)](const Vjp& v) { return gather_rows(v.grad(), rows); }});
}

}  // namespace stymo
