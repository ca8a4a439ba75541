#include "core/ops/reduce.h"

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/kernels/reduce.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {

namespace {

Variable sum_marked(const Variable& x, std::uint32_t reduced, const Shape& result_shape) {
    return record("sum", kernels::sum(x.value(), reduced).reshaped(result_shape), {x}, Save::none(),
                  {[reduced](const Vjp& v) {
                      Shape kept = v.shape(0);
                      for (int axis = 0; axis < kept.rank(); ++axis) {
                          if (((reduced >> axis) & 1U) != 0) kept = kept.with(axis, 1);
                      }
                      return broadcast_to(reshape(v.grad(), kept), v.shape(0));
                  }});
}

double count_along(const Shape& shape, const std::vector<int>& axes) {
    double count = 1.0;
    for (const int axis : axes) count *= static_cast<double>(shape[axis]);
    return count;
}

}  // namespace

Variable sum(const Variable& x) {
    return sum_marked(x, (1U << x.rank()) - 1U, {});
}

Variable sum(const Variable& x, const std::vector<int>& axes) {
    std::uint32_t reduced = 0;
    Shape kept = x.shape();
    for (const int axis : axes) {
        const int index = x.shape().index(axis);
        if (((reduced >> index) & 1U) != 0)
            fail<ShapeError>("[sum] axis ", axis, " of ", x.shape(), " given twice");
        reduced |= 1U << index;
        kept = kept.with(index, 1);
    }
    return reduced == 0 ? x : sum_marked(x, reduced, kept);
}

Variable mean(const Variable& x) {
    return sum(x) / static_cast<double>(x.value().size());
}

Variable mean(const Variable& x, const std::vector<int>& axes) {
    return sum(x, axes) / count_along(x.shape(), axes);
}

Variable sum_to(const Variable& x, const Shape& shape) {
    if (x.shape() == shape) return x;
    if (shape.rank() > x.rank() || broadcast_shape(shape, x.shape(), "sum_to") != x.shape())
        fail<ShapeError>("[sum_to] ", shape, " does not broadcast to ", x.shape());
    std::uint32_t reduced = 0;
    const int added = x.rank() - shape.rank();
    for (int axis = 0; axis < x.rank(); ++axis) {
        const bool repeated = axis < added || (shape[axis - added] == 1 && x.shape(axis) != 1);
        if (repeated) reduced |= 1U << axis;
    }
    return sum_marked(x, reduced, shape);
}

Variable cumsum(const Variable& x, int axis, bool exclusive) {
    const int index = x.shape().index(axis);
    return record("cumsum", kernels::cumsum(x.value(), index, exclusive), {x}, Save::none(),
                  {[index, exclusive](const Vjp& v) {
                      return flip(cumsum(flip(v.grad(), index), index, exclusive), index);
                  }});
}

Variable unit_channels_reference(const Variable& x, double epsilon) {
    const Variable squared_norm = sum(square(x), {-1});
    const Variable one = Tensor::scalar(1.0, x.dtype());
    const Variable norm = sqrt(where(squared_norm.value(), squared_norm, one));
    return x * (one / (norm + epsilon));
}

Variable unit_channels(const Variable& x, double epsilon) {
    return record("unit_channels", kernels::unit_channels(x.value(), epsilon), {x}, Save::input(0),
                  {[epsilon](const Vjp& v) {
                      const Variable in = v.input(0);
                      if (!v.create_graph())
                          return Variable(kernels::unit_channels_gradient(v.grad().value(),
                                                                          in.value(), epsilon));
                      return grad(unit_channels_reference(in, epsilon), in,
                                  {.create_graph = true, .dL_dy = v.grad()});
                  }});
}

Variable mean_squared_difference(const Variable& a, const Variable& b) {
    if (a.rank() != 4 || a.shape() != b.shape())
        fail<ShapeError>(
            "[mean_squared_difference] needs two images (b, h, w, c) of one shape, got ", a.shape(),
            " and ", b.shape());
    if (a.dtype() != b.dtype())
        fail<TypeError>("[mean_squared_difference] operands are ", a.dtype(), " and ", b.dtype());
    const auto gradient = [](const Vjp& v, double sign) {
        const double factor = sign * 2.0 / static_cast<double>(v.shape(0)[1] * v.shape(0)[2]);
        return (v.input(0) - v.input(1)) * (v.grad() * factor);
    };
    return record("mean_squared_difference", kernels::mean_squared_difference(a.value(), b.value()),
                  {a, b}, Save::all_inputs(),
                  {[=](const Vjp& v) { return gradient(v, 1.0); },
                   [=](const Vjp& v) { return gradient(v, -1.0); }});
}

}  // namespace stymo
