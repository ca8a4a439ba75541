#include "core/ops/channels.h"

#include "core/autograd/grad.h"
#include "core/autograd/record.h"
#include "core/error.h"
#include "core/kernels/channels.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"

namespace stymo {

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
