#include "core/ops/shape_ops.h"

#include <algorithm>
#include <numeric>

#include "core/autograd/node.h"
#include "core/error.h"
#include "core/kernels/elementwise.h"
#include "core/kernels/shape.h"
#include "core/ops/reduce.h"

namespace stymo {

Variable reshape(const Variable& x, const Shape& shape) {
    if (shape == x.shape()) return x;
    return record("reshape", x.value().reshaped(shape), {x}, Save::none(),
                  {[](const Vjp& v) { return reshape(v.grad(), v.shape(0)); }});
}

Variable reshape(const Variable& x, std::initializer_list<std::int64_t> extents) {
    std::vector<std::int64_t> filled(extents);
    const auto unknown = std::ranges::find(filled, -1);
    if (unknown != filled.end()) {
        *unknown = 1;
        const std::int64_t known =
            std::accumulate(filled.begin(), filled.end(), std::int64_t{1}, std::multiplies<>());
        if (known <= 0 || x.value().size() % known != 0)
            fail<ShapeError>("[reshape] ", x.shape(),
                             " has no whole extent for the axis left open");
        *unknown = x.value().size() / known;
    }
    return reshape(x, Shape(std::span<const std::int64_t>(filled)));
}

Variable permute(const Variable& x, const std::vector<int>& order) {
    const auto rank = static_cast<std::size_t>(x.rank());
    std::vector<int> inverse(rank, -1);
    bool valid = order.size() == rank;
    for (std::size_t i = 0; valid && i < rank; ++i) {
        valid =
            order[i] >= 0 && order[i] < x.rank() && inverse[static_cast<std::size_t>(order[i])] < 0;
        if (valid) inverse[static_cast<std::size_t>(order[i])] = static_cast<int>(i);
    }
    if (!valid)
        fail<ShapeError>("[permute] the order is not a permutation of the ", rank, " axes of ",
                         x.shape());
    return record("permute", kernels::permute(x.value(), order), {x}, Save::none(),
                  {[inverse](const Vjp& v) { return permute(v.grad(), inverse); }});
}

Variable transpose(const Variable& x) {
    if (x.rank() < 2) fail<ShapeError>("[transpose] needs two axes, got ", x.shape());
    std::vector<int> order(static_cast<std::size_t>(x.rank()));
    std::iota(order.begin(), order.end(), 0);
    std::swap(order[order.size() - 1], order[order.size() - 2]);
    return permute(x, order);
}

Variable flip(const Variable& x, int axis) {
    const int index = x.shape().index(axis);
    return record("flip", kernels::flip(x.value(), index), {x}, Save::none(),
                  {[index](const Vjp& v) { return flip(v.grad(), index); }});
}

Variable slice(const Variable& x, int axis, std::int64_t begin, std::int64_t end) {
    const int index = x.shape().index(axis);
    const std::int64_t extent = x.shape(index);
    if (begin < 0 || begin > end || end > extent)
        fail<ShapeError>("[slice] [", begin, ", ", end, ") is not within axis ", axis, " of ",
                         x.shape());
    if (begin == 0 && end == extent) return x;
    return record("slice", kernels::slice(x.value(), index, begin, end), {x}, Save::none(),
                  {[=](const Vjp& v) { return pad(v.grad(), index, begin, extent - end); }});
}

Variable pad(const Variable& x, int axis, std::int64_t before, std::int64_t after) {
    const int index = x.shape().index(axis);
    if (before < 0 || after < 0) fail<ShapeError>("[pad] negative amount ", before, ", ", after);
    std::vector<Variable> parts;
    if (before > 0) parts.emplace_back(Tensor::zeros(x.shape().with(index, before), x.dtype()));
    parts.push_back(x);
    if (after > 0) parts.emplace_back(Tensor::zeros(x.shape().with(index, after), x.dtype()));
    return concat(parts, index);
}

Variable concat(const std::vector<Variable>& parts, int axis) {
    if (parts.empty()) fail<ShapeError>("[concat] nothing to join");
    if (parts.size() == 1) return parts.front();
    const int index = parts.front().shape().index(axis);
    std::vector<Tensor> values;
    std::vector<VjpRule> rules;
    std::int64_t begin = 0;
    for (const Variable& part : parts) {
        values.push_back(part.value());
        const std::int64_t end =
            begin + (part.rank() == parts.front().rank() ? part.shape(index) : 0);
        rules.emplace_back([=](const Vjp& v) { return slice(v.grad(), index, begin, end); });
        begin = end;
    }
    return record("concat", kernels::concat(values, index), parts, Save::none(), std::move(rules));
}

Variable broadcast_to(const Variable& x, const Shape& shape) {
    if (x.shape() == shape) return x;
    return record("broadcast_to", kernels::broadcast_to(x.value(), shape), {x}, Save::none(),
                  {[](const Vjp& v) { return sum_to(v.grad(), v.shape(0)); }});
}

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
