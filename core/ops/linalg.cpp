#include "core/ops/linalg.h"

#include <numbers>

#include "core/autograd/node.h"
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
    if (a.shape(options.transpose_a ? -2 : -1) != b.shape(options.transpose_b ? -1 : -2))
        fail<ShapeError>("[matmul] inner extents differ: ", a.shape(),
                         options.transpose_a ? " transposed" : "", " x ", b.shape(),
                         options.transpose_b ? " transposed" : "");
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
        (weight.shape(0) != 1 && weight.shape(0) != x.shape(0)))
        fail<ShapeError>("[linear] x ", x.shape(), " and weight ", weight.shape(),
                         " are not (batch, rows, in) and (batch or 1, out, in)");
    if (bias.defined() && bias.shape() != Shape{weight.shape(1)})
        fail<ShapeError>("[linear] bias ", bias.shape(), " for ", weight.shape(1), " outputs");
    if (x.dtype() != weight.dtype())
        fail<TypeError>("[linear] x is ", x.dtype(), ", weight ", weight.dtype());
}

/// Gradients of the linear map x W^T + bias for that of its result.
Variable input_gradient(const Variable& dL_dz, const Variable& weight) {
    return matmul(dL_dz, weight);
}

Variable weight_gradient(const Variable& dL_dz, const Variable& x, bool shares_weight) {
    if (!shares_weight) return matmul(dL_dz, x, {.transpose_a = true});
    // One weight for the whole batch: the batch is just more rows.
    const std::int64_t rows = x.shape(0) * x.shape(1);
    return matmul(reshape(dL_dz, {1, rows, dL_dz.shape(2)}), reshape(x, {1, rows, x.shape(2)}),
                  {.transpose_a = true});
}

Variable bias_gradient(const Variable& dL_dz) {
    return sum_to(dL_dz, {dL_dz.shape(2)});
}

/// The graph's view of the linear map alone. Its value is never read (the activation is fused
/// behind it), so any tensor of the right shape stands in for it.
Variable record_linear_map(const Tensor& shaped, const Variable& x, const Variable& weight,
                           const Variable& bias) {
    const Save save = (weight.tracked() ? Save::input(0) : Save::none()) |
                      (x.tracked() ? Save::input(1) : Save::none());
    std::vector<Variable> inputs{x, weight};
    std::vector<VjpRule> rules{[](const Vjp& v) { return input_gradient(v.grad(), v.input(1)); },
                               [](const Vjp& v) {
                                   return weight_gradient(v.grad(), v.input(0),
                                                          v.shape(1)[0] != v.shape(0)[0]);
                               }};
    if (bias.defined()) {
        inputs.push_back(bias);
        rules.emplace_back([](const Vjp& v) { return bias_gradient(v.grad()); });
    }
    return record("linear", shaped, std::move(inputs), save, std::move(rules));
}

constexpr double leaky_slope = 0.2;
constexpr double leaky_gain = std::numbers::sqrt2;

/// The layer with its leaky ReLU. The slope follows from the sign of the output, which the next
/// layer keeps anyway.
Variable record_leaky_layer(const Tensor& output, const Variable& x, const Variable& weight,
                            const Variable& bias) {
    std::vector<Node::Input> inputs{
        {x.node(), weight.tracked() ? x.value() : Tensor(), x.shape()},
        {weight.node(), x.tracked() ? weight.value() : Tensor(), weight.shape()}};
    if (bias.defined()) inputs.push_back({bias.node(), {}, bias.shape()});
    const JointVjpRule rule = [](const Vjp& v, const std::vector<bool>& needed) {
        const Tensor y = v.output().value();
        const bool shares_weight = v.shape(1)[0] != v.shape(0)[0];
        const bool with_bias = needed.size() > 2 && needed[2];
        std::vector<Variable> gradients(needed.size());
        if (v.create_graph()) {
            const Variable dL_dz = leaky_gate(v.grad(), y, leaky_slope, leaky_gain);
            if (needed[0]) gradients[0] = input_gradient(dL_dz, v.input(1));
            if (needed[1]) gradients[1] = weight_gradient(dL_dz, v.input(0), shares_weight);
            if (with_bias) gradients[2] = bias_gradient(dL_dz);
            return gradients;
        }
        const kernels::LinearGradients found = kernels::leaky_linear_gradients(
            v.grad().value(),
            {needed[1] ? v.input(0).value() : Tensor(), needed[0] ? v.input(1).value() : Tensor(),
             y, leaky_slope, leaky_gain},
            shares_weight, {needed[0], needed[1], with_bias});
        if (needed[0]) gradients[0] = Variable(found.x);
        if (needed[1]) gradients[1] = Variable(found.weight);
        if (with_bias) gradients[2] = Variable(found.bias);
        return gradients;
    };
    return record("linear", output, std::move(inputs), rule, true);
}

Variable apply(Activation activation, const Variable& x) {
    switch (activation) {
        case Activation::sine: return sin(x);
        case Activation::leaky_relu: return leaky_relu(x, leaky_slope) * leaky_gain;
        case Activation::none: break;
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
    if (activation == Activation::leaky_relu)
        return record_leaky_layer(result.value, x, weight, bias);
    const Variable map = record_linear_map(result.value, x, weight, bias);
    if (activation == Activation::none) return map;
    return record("linear_activation", result.value, {map}, Save::none(),
                  {[=, slope = result.slope](const Vjp& v) {
                      if (!v.create_graph()) return v.grad() * Variable(slope);
                      // The slope of the sine is differentiated through the composition.
                      return v.grad() * cos(linear_reference(x, weight, bias, Activation::none));
                  }});
}

}  // namespace stymo
