#include "core/ops/linalg.h"

#include <numbers>

#include "core/autograd/record.h"
#include "core/error.h"
#include "core/kernels/matmul.h"
#include "core/ops/activation.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"

namespace stymo {

namespace {

void check_matmul(const Variable& a, const Variable& b, MatmulOptions options) {
    if (a.dtype() != b.dtype())
        fail<TypeError>("[matmul] operands are ", a.dtype(), " and ", b.dtype());
    if (a.shape(options.transpose_a ? -2 : -1) != b.shape(options.transpose_b ? -1 : -2)) {
        fail<ShapeError>("[matmul] inner extents differ: ", a.shape(),
                         options.transpose_a ? " transposed" : "", " x ", b.shape(),
                         options.transpose_b ? " transposed" : "");
    }
    if (a.shape(0) != b.shape(0) && a.shape(0) != 1 && b.shape(0) != 1)
        fail<ShapeError>("[matmul] leading extents differ: ", a.shape(), " x ", b.shape());
}

/// Gradient of the left operand: with C = op(A) op(B), dA = dC op(B)^T, or its transpose where A
/// enters transposed.
Variable left_gradient(const Variable& dL_dc, const Variable& b, MatmulOptions options) {
    return options.transpose_a
               ? matmul(b, dL_dc, {.transpose_a = options.transpose_b, .transpose_b = true})
               : matmul(dL_dc, b, {.transpose_a = false, .transpose_b = !options.transpose_b});
}

Variable right_gradient(const Variable& dL_dc, const Variable& a, MatmulOptions options) {
    return options.transpose_b
               ? matmul(dL_dc, a, {.transpose_a = true, .transpose_b = options.transpose_a})
               : matmul(a, dL_dc, {.transpose_a = !options.transpose_a, .transpose_b = false});
}

Variable batched_matmul(const Variable& a, const Variable& b, MatmulOptions options) {
    const Save save = (b.tracked() ? Save::input(0) : Save::none()) |
                      (a.tracked() ? Save::input(1) : Save::none());
    return record("matmul", kernels::matmul(a.value(), b.value(), options), {a, b}, save,
                  {[options](const Vjp& v) {
                       return sum_to(left_gradient(v.grad(), v.input(1), options), v.shape(0));
                   },
                   [options](const Vjp& v) {
                       return sum_to(right_gradient(v.grad(), v.input(0), options), v.shape(1));
                   }});
}

}  // namespace

Variable matmul(const Variable& a, const Variable& b, MatmulOptions options) {
    if (a.rank() != b.rank() || (a.rank() != 2 && a.rank() != 3))
        fail<ShapeError>("[matmul] needs two matrices or two batches of them, got ", a.shape(),
                         " x ", b.shape());
    if (a.rank() == 3) {
        check_matmul(a, b, options);
        return batched_matmul(a, b, options);
    }
    const Variable c = matmul(reshape(a, {1, a.shape(0), a.shape(1)}),
                              reshape(b, {1, b.shape(0), b.shape(1)}), options);
    return reshape(c, {c.shape(1), c.shape(2)});
}

namespace {

void check_linear(const Variable& x, const Variable& weight, const Variable& bias) {
    if (x.rank() != 3 || weight.rank() != 3 || x.shape(2) != weight.shape(2) ||
        (weight.shape(0) != 1 && weight.shape(0) != x.shape(0))) {
        fail<ShapeError>("[linear] x ", x.shape(), " and weight ", weight.shape(),
                         " are not (batch, rows, in) and (batch or 1, out, in)");
    }
    if (bias.defined() && bias.shape() != Shape{weight.shape(1)})
        fail<ShapeError>("[linear] bias ", bias.shape(), " for ", weight.shape(1), " outputs");
    if (x.dtype() != weight.dtype())
        fail<TypeError>("[linear] x is ", x.dtype(), ", weight ", weight.dtype());
}

/// The graph's view of the linear map alone. Its value is never read (the activation is fused
/// behind it), so any tensor of the right shape stands in for it.
Variable record_linear_map(const Tensor& shaped, const Variable& x, const Variable& weight,
                           const Variable& bias) {
    const Save save = (weight.tracked() ? Save::input(0) : Save::none()) |
                      (x.tracked() ? Save::input(1) : Save::none());
    std::vector<Variable> inputs{x, weight};
    std::vector<VjpRule> rules{[](const Vjp& v) { return matmul(v.grad(), v.input(1)); },
                               [](const Vjp& v) {
                                   const Variable x_in = v.input(0);
                                   if (v.shape(1)[0] == x_in.shape(0))
                                       return matmul(v.grad(), x_in, {.transpose_a = true});
                                   // One weight for the whole batch: the batch is just more rows.
                                   return matmul(reshape(v.grad(), {1, -1, v.grad().shape(2)}),
                                                 reshape(x_in, {1, -1, x_in.shape(2)}),
                                                 {.transpose_a = true});
                               }};
    if (bias.defined()) {
        inputs.push_back(bias);
        rules.emplace_back([](const Vjp& v) { return sum_to(v.grad(), v.shape(2)); });
    }
    return record("linear", shaped, std::move(inputs), save, std::move(rules));
}

Variable apply(Activation activation, const Variable& x) {
    switch (activation) {
        case Activation::sine:
            return sin(x);
        case Activation::leaky_relu:
            return leaky_relu(x, 0.2) * std::numbers::sqrt2;
        case Activation::none:
            break;
    }
    return x;
}

}  // namespace

Variable linear_reference(const Variable& x, const Variable& weight, const Variable& bias,
                          Activation activation) {
    check_linear(x, weight, bias);
    const Variable product = matmul(x, weight, {.transpose_b = true});
    return apply(activation, bias.defined() ? product + bias : product);
}

Variable linear(const Variable& x, const Variable& weight, const Variable& bias,
                Activation activation) {
    check_linear(x, weight, bias);
    const bool tracked = x.tracked() || weight.tracked() || (bias.defined() && bias.tracked());
    const bool with_slope = tracked && activation == Activation::sine;
    const kernels::LinearResult result =
        kernels::linear(x.value(), weight.value(), bias.defined() ? bias.value() : Tensor{},
                        activation, with_slope);
    if (!tracked) return Variable(result.value);
    const Variable map = record_linear_map(result.value, x, weight, bias);
    if (activation == Activation::none) return map;
    if (activation == Activation::leaky_relu) {
        // The slope follows from the sign of the output, and the next layer keeps the output
        // anyway.
        return record("linear_activation", result.value, {map}, Save::the_output(),
                      {[](const Vjp& v) {
                          return leaky_gate(v.grad(), v.output().value(), 0.2, std::numbers::sqrt2);
                      }});
    }
    return record("linear_activation", result.value, {map}, Save::none(),
                  {[=, slope = result.slope](const Vjp& v) {
                      if (!v.create_graph()) return v.grad() * Variable(slope);
                      // The slope of the sine is differentiated through the composition.
                      return v.grad() * cos(linear_reference(x, weight, bias, Activation::none));
                  }});
}

}  // namespace stymo
