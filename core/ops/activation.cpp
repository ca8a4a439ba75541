#include "core/ops/activation.h"

#include "core/autograd/node.h"
#include "core/error.h"
#include "core/kernels/elementwise.h"
#include "core/kernels/reduce.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"

namespace stymo {

Variable sigmoid(const Variable& x) {
    // 1 - y would lose all precision where y is near 1.
    return record("sigmoid", kernels::sigmoid(x.value()), {x}, Save::the_output() | Save::input(0),
                  {[](const Vjp& v) { return v.grad() * (v.output() * sigmoid(-v.input(0))); }});
}

Variable tanh(const Variable& x) {
    // 1 - y^2 would lose all precision where |y| is near 1.
    return record("tanh", kernels::tanh(x.value()), {x}, Save::input(0), {[](const Vjp& v) {
                      const Variable twice = v.input(0) * 2.0;
                      return v.grad() * (sigmoid(twice) * sigmoid(-twice) * 4.0);
                  }});
}

Variable softplus(const Variable& x) {
    return record("softplus", kernels::softplus(x.value()), {x}, Save::input(0),
                  {[](const Vjp& v) { return v.grad() * sigmoid(v.input(0)); }});
}

Variable leaky_relu(const Variable& x, double slope) {
    if (!(slope >= 0.0))
        fail<ValueError>("[leaky_relu] the slope must not be negative, got ", slope);
    // The output has the sign of the input, and the next layer keeps the output anyway.
    return record(
        "leaky_relu", kernels::leaky_relu(x.value(), slope), {x}, Save::the_output(),
        {[slope](const Vjp& v) { return leaky_gate(v.grad(), v.output().value(), slope); }});
}

Variable leaky_gate(const Variable& x, const Tensor& sign, double slope, double gain) {
    if (x.shape() != sign.shape())
        fail<ShapeError>("[leaky_gate] x is ", x.shape(), ", the signs ", sign.shape());
    return record(
        "leaky_gate", kernels::leaky_gate(x.value(), sign, slope, gain), {x}, Save::none(),
        {[sign, slope, gain](const Vjp& v) { return leaky_gate(v.grad(), sign, slope, gain); }});
}

Variable prelu(const Variable& x, const Variable& slope) {
    // One op instead of a composition, so that a deep network keeps one image per activation
    // instead of three.
    return record("prelu", kernels::prelu(x.value(), slope.value()), {x, slope},
                  Save::input(0) | Save::input(1),
                  {[](const Vjp& v) {
                       const Tensor positive = kernels::leaky_slope(v.input(0).value(), 0.0);
                       return where(positive, v.grad(), v.grad() * v.input(1));
                   },
                   [](const Vjp& v) { return -sum_to(v.grad() * relu(-v.input(0)), v.shape(1)); }});
}

Variable binary_cross_entropy_with_logits(const Variable& logit, const Variable& target) {
    // softplus(logit) - logit * target would cancel for large logits.
    return softplus(logit) * affine(target, -1.0, 1.0) + softplus(-logit) * target;
}

}  // namespace stymo
