#include "core/ops/elementwise.h"

#include "core/autograd/node.h"
#include "core/error.h"
#include "core/kernels/elementwise.h"
#include "core/ops/reduce.h"

namespace stymo {

Variable add(const Variable& a, const Variable& b) {
    return record("add", kernels::add(a.value(), b.value()), {a, b}, Save::none(),
                  {[](const Vjp& v) { return sum_to(v.grad(), v.shape(0)); },
                   [](const Vjp& v) { return sum_to(v.grad(), v.shape(1)); }});
}

Variable subtract(const Variable& a, const Variable& b) {
    return record("subtract", kernels::subtract(a.value(), b.value()), {a, b}, Save::none(),
                  {[](const Vjp& v) { return sum_to(v.grad(), v.shape(0)); },
                   [](const Vjp& v) { return -sum_to(v.grad(), v.shape(1)); }});
}

namespace {

/// A factor is needed only for the gradient of the other one.
Save save_other_factor(const Variable& a, const Variable& b) {
    return (b.tracked() ? Save::input(0) : Save::none()) |
           (a.tracked() ? Save::input(1) : Save::none());
}

}  // namespace

Variable multiply(const Variable& a, const Variable& b) {
    return record("multiply", kernels::multiply(a.value(), b.value()), {a, b},
                  save_other_factor(a, b),
                  {[](const Vjp& v) { return sum_to(v.grad() * v.input(1), v.shape(0)); },
                   [](const Vjp& v) { return sum_to(v.grad() * v.input(0), v.shape(1)); }});
}

Variable divide(const Variable& a, const Variable& b) {
    return record(
        "divide", kernels::divide(a.value(), b.value()), {a, b},
        Save::input(1) | Save::the_output(),
        {[](const Vjp& v) { return sum_to(v.grad() / v.input(1), v.shape(0)); },
         [](const Vjp& v) { return -sum_to(v.grad() * v.output() / v.input(1), v.shape(1)); }});
}

namespace {

Variable choose(const char* name, Tensor value, const Tensor& takes_a, const Variable& a,
                const Variable& b);

/// The gradient where the mask is 1, else 0: of an infinite one a product would make NaN.
Variable kept(const Variable& gradient, const Tensor& mask) {
    const Variable zeros(Tensor::zeros(gradient.shape(), gradient.dtype()));
    return choose("where", kernels::select(mask, gradient.value(), zeros.value()), mask, gradient,
                  zeros);
}

/// The gradient goes to `a` where the mask is 1 and to `b` where it is 0. The mask is a constant,
/// so it carries no edge into the second derivative.
Variable choose(const char* name, Tensor value, const Tensor& takes_a, const Variable& a,
                const Variable& b) {
    return record(name, std::move(value), {a, b}, Save::none(),
                  {[takes_a](const Vjp& v) { return sum_to(kept(v.grad(), takes_a), v.shape(0)); },
                   [takes_a](const Vjp& v) {
                       return sum_to(kept(v.grad(), kernels::affine(takes_a, -1.0, 1.0)),
                                     v.shape(1));
                   }});
}

}  // namespace

Variable maximum(const Variable& a, const Variable& b) {
    return choose("maximum", kernels::maximum(a.value(), b.value()),
                  kernels::takes_maximum(a.value(), b.value()), a, b);
}

Variable minimum(const Variable& a, const Variable& b) {
    return choose("minimum", kernels::minimum(a.value(), b.value()),
                  kernels::takes_minimum(a.value(), b.value()), a, b);
}

Variable where(const Tensor& condition, const Variable& a, const Variable& b) {
    const Shape shape =
        broadcast_shape(broadcast_shape(a.shape(), b.shape(), "where"), condition.shape(), "where");
    const Tensor takes_a = kernels::broadcast_to(kernels::nonzero(condition), shape);
    return choose("where",
                  kernels::select(takes_a, kernels::broadcast_to(a.value(), shape),
                                  kernels::broadcast_to(b.value(), shape)),
                  takes_a, a, b);
}

Variable negate(const Variable& x) {
    return affine(x, -1.0, 0.0);
}

Variable affine(const Variable& x, double factor, double offset) {
    return record("affine", kernels::affine(x.value(), factor, offset), {x}, Save::none(),
                  {[factor](const Vjp& v) { return affine(v.grad(), factor, 0.0); }});
}

Variable exp(const Variable& x) {
    return record("exp", kernels::exp(x.value()), {x}, Save::the_output(),
                  {[](const Vjp& v) { return v.grad() * v.output(); }});
}

Variable log(const Variable& x) {
    return record("log", kernels::log(x.value()), {x}, Save::input(0),
                  {[](const Vjp& v) { return v.grad() / v.input(0); }});
}

Variable sin(const Variable& x) {
    return record("sin", kernels::sin(x.value()), {x}, Save::input(0),
                  {[](const Vjp& v) { return v.grad() * cos(v.input(0)); }});
}

Variable cos(const Variable& x) {
    return record("cos", kernels::cos(x.value()), {x}, Save::input(0),
                  {[](const Vjp& v) { return -(v.grad() * sin(v.input(0))); }});
}

Variable sqrt(const Variable& x) {
    return record("sqrt", kernels::sqrt(x.value()), {x}, Save::the_output(),
                  {[](const Vjp& v) { return 0.5 * (v.grad() / v.output()); }});
}

Variable square(const Variable& x) {
    return record("square", kernels::square(x.value()), {x}, Save::input(0),
                  {[](const Vjp& v) { return 2.0 * (v.grad() * v.input(0)); }});
}

Variable abs(const Variable& x) {
    return record("abs", kernels::abs(x.value()), {x}, Save::input(0), {[](const Vjp& v) {
                      return v.grad() * Variable(kernels::sign(v.input(0).value()));
                  }});
}

namespace {

/// x where `selector` is in [low, high], else 0.
Variable where_within(const Variable& x, const Tensor& selector, double low, double high) {
    return record("where_within", kernels::where_within(x.value(), selector, low, high), {x},
                  Save::none(),
                  {[=](const Vjp& v) { return where_within(v.grad(), selector, low, high); }});
}

}  // namespace

Variable clamp(const Variable& x, double low, double high) {
    if (!(low <= high)) fail<ValueError>("[clamp] low ", low, " is above high ", high);
    return record("clamp", kernels::clamp(x.value(), low, high), {x}, Save::input(0),
                  {[low, high](const Vjp& v) {
                      return where_within(v.grad(), v.input(0).value(), low, high);
                  }});
}

}  // namespace stymo
