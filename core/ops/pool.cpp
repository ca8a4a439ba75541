#include "core/ops/pool.h"

#include <memory>

#include "core/autograd/record.h"
#include "core/error.h"
#include "core/kernels/pool.h"

namespace stymo {

namespace {

/// Shared by an op, its adjoint and the adjoint of that.
using SharedIndices = std::shared_ptr<const kernels::WindowIndices>;

std::int64_t output_length(std::int64_t length, const MaxPoolOptions& options) {
    const std::int64_t rest = length - options.kernel;
    if (!options.ceil_mode) return rest < 0 ? 0 : rest / options.stride + 1;
    if (rest <= -options.stride) return 0;
    const std::int64_t count = (rest + options.stride - 1) / options.stride + 1;
    // A last window must begin within the image.
    return (count - 1) * options.stride < length ? count : count - 1;
}

Shape output_shape(const Shape& x, const MaxPoolOptions& options) {
    if (options.kernel < 1 || options.kernel > kernels::max_pool_kernel || options.stride < 1) {
        fail<ValueError>("[max_pool2d] kernel ", options.kernel, ", stride ", options.stride,
                         "; the kernel must be at most ", kernels::max_pool_kernel);
    }
    if (x.rank() != 4) fail<ShapeError>("[max_pool2d] needs an image (b, h, w, c), got ", x);
    const Shape shape{x[0], output_length(x[1], options), output_length(x[2], options), x[3]};
    if (shape[1] < 1 || shape[2] < 1)
        fail<ShapeError>("[max_pool2d] no window of side ", options.kernel, " fits the image ", x);
    return shape;
}

Variable scatter_windows(const Variable& y, const SharedIndices& indices, const Shape& input_shape,
                         const MaxPoolOptions& options);

Variable gather_windows(const Variable& x, const SharedIndices& indices, const Shape& shape,
                        const MaxPoolOptions& options) {
    return record("gather_windows", kernels::gather_windows(x.value(), *indices, shape, options),
                  {x}, Save::none(), {[=](const Vjp& v) {
                      return scatter_windows(v.grad(), indices, v.shape(0), options);
                  }});
}

Variable scatter_windows(const Variable& y, const SharedIndices& indices, const Shape& input_shape,
                         const MaxPoolOptions& options) {
    return record(
        "scatter_windows", kernels::scatter_windows(y.value(), *indices, input_shape, options), {y},
        Save::none(),
        {[=](const Vjp& v) { return gather_windows(v.grad(), indices, v.shape(0), options); }});
}

}  // namespace

Variable max_pool2d(const Variable& x, const MaxPoolOptions& options) {
    kernels::MaxPooled pooled =
        kernels::max_pool2d(x.value(), output_shape(x.shape(), options), options);
    const auto indices = std::make_shared<const kernels::WindowIndices>(std::move(pooled.indices));
    return record("max_pool2d", std::move(pooled.values), {x}, Save::none(), {[=](const Vjp& v) {
                      return scatter_windows(v.grad(), indices, v.shape(0), options);
                  }});
}

}  // namespace stymo
