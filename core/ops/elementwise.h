#pragma once

#include "core/autograd/variable.h"

/// Elementwise operations. Two operands broadcast as in NumPy; the gradient of a broadcast operand
/// is summed back to its shape. Throw ShapeError for shapes that do not broadcast, TypeError for
/// different element types.
namespace stymo {

[[nodiscard]] Variable add(const Variable& a, const Variable& b);
[[nodiscard]] Variable subtract(const Variable& a, const Variable& b);
[[nodiscard]] Variable multiply(const Variable& a, const Variable& b);
[[nodiscard]] Variable divide(const Variable& a, const Variable& b);
/// Larger of the two; at a tie the gradient goes to `a`.
[[nodiscard]] Variable maximum(const Variable& a, const Variable& b);
/// Smaller of the two; at a tie the gradient goes to `a`.
[[nodiscard]] Variable minimum(const Variable& a, const Variable& b);
/// `a` where `condition` is not 0, else `b`. No gradient flows to the condition, which is a
/// constant.
[[nodiscard]] Variable where(const Tensor& condition, const Variable& a, const Variable& b);

[[nodiscard]] Variable negate(const Variable& x);
/// factor * x + offset
[[nodiscard]] Variable affine(const Variable& x, double factor, double offset);
[[nodiscard]] Variable exp(const Variable& x);
[[nodiscard]] Variable log(const Variable& x);
[[nodiscard]] Variable sin(const Variable& x);
[[nodiscard]] Variable cos(const Variable& x);
/// The gradient at 0 is infinite; use `sqrt(add(x, epsilon))` where x may be 0.
[[nodiscard]] Variable sqrt(const Variable& x);
[[nodiscard]] Variable square(const Variable& x);
/// Subgradient 0 at 0.
[[nodiscard]] Variable abs(const Variable& x);
/// The gradient is 1 within [low, high] (ends included) and 0 outside. Throws ValueError unless low
/// <= high.
[[nodiscard]] Variable clamp(const Variable& x, double low, double high);

[[nodiscard]] inline Variable operator+(const Variable& a, const Variable& b) {
    return add(a, b);
}
[[nodiscard]] inline Variable operator-(const Variable& a, const Variable& b) {
    return subtract(a, b);
}
[[nodiscard]] inline Variable operator*(const Variable& a, const Variable& b) {
    return multiply(a, b);
}
[[nodiscard]] inline Variable operator/(const Variable& a, const Variable& b) {
    return divide(a, b);
}
[[nodiscard]] inline Variable operator-(const Variable& x) {
    return negate(x);
}
[[nodiscard]] inline Variable operator+(const Variable& x, double offset) {
    return affine(x, 1.0, offset);
}
[[nodiscard]] inline Variable operator-(const Variable& x, double offset) {
    return affine(x, 1.0, -offset);
}
[[nodiscard]] inline Variable operator*(const Variable& x, double factor) {
    return affine(x, factor, 0.0);
}
[[nodiscard]] inline Variable operator*(double factor, const Variable& x) {
    return affine(x, factor, 0.0);
}
[[nodiscard]] inline Variable operator/(const Variable& x, double divisor) {
    return affine(x, 1.0 / divisor, 0.0);
}

}  // namespace stymo
