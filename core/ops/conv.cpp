#include "core/ops/conv.h"

#include <memory>

#include "core/autograd/node.h"
#include "core/error.h"
#include "core/kernels/conv.h"
#include "core/kernels/pool.h"
#include "core/ops/activation.h"
#include "core/ops/reduce.h"

namespace stymo {

namespace {

Shape output_shape(const Shape& x, const Shape& weight, const Conv2dOptions& options,
                   const char* name) {
    if (x.rank() != 4 || weight.rank() != 4)
        fail<ShapeError>("[", name,
                         "] needs an image (b, h, w, c) and a weight (out, kh, kw, in), got ", x,
                         " and ", weight);
    if (options.stride < 1 || options.padding < 0 || options.groups < 1)
        fail<ValueError>("[", name, "] stride ", options.stride, ", padding ", options.padding,
                         ", groups ", options.groups);
    if (weight[3] * options.groups != x[3] || weight[0] % options.groups != 0)
        fail<ShapeError>("[", name, "] ", x[3], " channels and weight ", weight, " do not fit ",
                         options.groups, " groups");
    const std::int64_t height = x[1] + 2 * options.padding - weight[1];
    const std::int64_t width = x[2] + 2 * options.padding - weight[2];
    if (height < 0 || width < 0)
        fail<ShapeError>("[", name, "] kernel ", weight, " is larger than the padded image ", x);
    return {x[0], height / options.stride + 1, width / options.stride + 1, weight[0]};
}

void require_output(const Shape& dL_dy, const Shape& x, const Shape& weight,
                    const Conv2dOptions& options, const char* name) {
    const Shape expected = output_shape(x, weight, options, name);
    if (dL_dy != expected)
        fail<ShapeError>("[", name, "] the output's gradient is ", dL_dy, ", expected ", expected);
}

void require_same_type(const Variable& a, const Variable& b, const char* name) {
    if (a.dtype() != b.dtype())
        fail<TypeError>("[", name, "] operands are ", a.dtype(), " and ", b.dtype());
}

/// The convolution `y` with its activation if only x is tracked. The gradient then needs no gated
/// copy of the output's gradient.
Variable record_frozen(const Variable& x, const Variable& weight, Tensor y, double slope,
                       const Conv2dOptions& options) {
    return record(
        "conv2d", std::move(y), {x}, Save::the_output(), {[weight, slope, options](const Vjp& v) {
            if (v.create_graph())
                return conv2d_transpose(leaky_gate(v.grad(), v.output().value(), slope), weight,
                                        v.shape(0), options);
            return Variable(kernels::conv2d_gated_transpose(
                v.grad().value(), v.output().value(), slope, weight.value(), v.shape(0), options));
        }});
}

Save save_both(const Variable& a, const Variable& b) {
    return (b.tracked() ? Save::input(0) : Save::none()) |
           (a.tracked() ? Save::input(1) : Save::none());
}

}  // namespace

Variable conv2d(const Variable& x, const Variable& weight, const Conv2dOptions& options) {
    return conv2d(x, weight, Variable(), 1.0, options);
}

Variable conv2d(const Variable& x, const Variable& weight, const Variable& bias, double slope,
                const Conv2dOptions& options) {
    const Shape shape = output_shape(x.shape(), weight.shape(), options, "conv2d");
    require_same_type(x, weight, "conv2d");
    if (bias.defined()) {
        require_same_type(x, bias, "conv2d");
        if (bias.shape() != Shape{shape[3]})
            fail<ShapeError>("[conv2d] bias ", bias.shape(), " for ", shape[3], " channels");
    }
    if (!(slope >= 0.0)) fail<ValueError>("[conv2d] the slope must not be negative, got ", slope);
    const Tensor y = kernels::conv2d(
        x.value(), weight.value(), bias.defined() ? bias.value() : Tensor{}, slope, shape, options);
    if (slope != 1.0 && !weight.tracked() && !(bias.defined() && bias.tracked()))
        return record_frozen(x, weight, y, slope, options);
    std::vector<Variable> inputs{x, weight};
    std::vector<VjpRule> rules{
        [options](const Vjp& v) {
            return conv2d_transpose(v.grad(), v.input(1), v.shape(0), options);
        },
        [options](const Vjp& v) {
            return conv2d_weight_grad(v.grad(), v.input(0), v.shape(1), options);
        }};
    if (bias.defined()) {
        inputs.push_back(bias);
        rules.emplace_back([](const Vjp& v) { return sum_to(v.grad(), v.shape(2)); });
    }
    // The map's value is never read where an activation is fused behind it, so any tensor of its
    // shape stands in for it.
    const Variable map =
        record("conv2d", y, std::move(inputs), save_both(x, weight), std::move(rules));
    if (slope == 1.0 || !map.tracked()) return map;
    return record("conv2d_activation", y, {map}, Save::the_output(), {[slope](const Vjp& v) {
                      return leaky_gate(v.grad(), v.output().value(), slope);
                  }});
}

Variable conv2d_transpose(const Variable& dL_dy, const Variable& weight, const Shape& input_shape,
                          const Conv2dOptions& options) {
    require_output(dL_dy.shape(), input_shape, weight.shape(), options, "conv2d_transpose");
    require_same_type(dL_dy, weight, "conv2d_transpose");
    return record("conv2d_transpose",
                  kernels::conv2d_transpose(dL_dy.value(), weight.value(), input_shape, options),
                  {dL_dy, weight}, save_both(dL_dy, weight),
                  {[options](const Vjp& v) { return conv2d(v.grad(), v.input(1), options); },
                   [options](const Vjp& v) {
                       return conv2d_weight_grad(v.input(0), v.grad(), v.shape(1), options);
                   }});
}

Variable conv2d_weight_grad(const Variable& dL_dy, const Variable& x, const Shape& weight_shape,
                            const Conv2dOptions& options) {
    require_output(dL_dy.shape(), x.shape(), weight_shape, options, "conv2d_weight_grad");
    require_same_type(dL_dy, x, "conv2d_weight_grad");
    return record("conv2d_weight_grad",
                  kernels::conv2d_weight_grad(dL_dy.value(), x.value(), weight_shape, options),
                  {dL_dy, x}, save_both(dL_dy, x),
                  {[options](const Vjp& v) { return conv2d(v.input(1), v.grad(), options); },
                   [options](const Vjp& v) {
                       return conv2d_transpose(v.input(0), v.grad(), v.shape(1), options);
                   }});
}

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
