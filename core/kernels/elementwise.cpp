#include "core/kernels/elementwise.h"

#include <cmath>

#include "core/kernels/map.h"
#include "core/kernels/sine.h"

namespace stymo::kernels {
namespace {

/// Whether maximum and minimum take their first operand. A NaN in either operand is taken.
template <class T>
bool at_least(T x, T y) {
    return x >= y || std::isnan(x);
}
template <class T>
bool at_most(T x, T y) {
    return x <= y || std::isnan(x);
}

}  // namespace

BroadcastPlan plan_broadcast(const Shape& a, const Shape& b, const char* operation) {
    BroadcastPlan plan;
    plan.shape = broadcast_shape(a, b, operation);
    std::vector<BroadcastPlan::Axis> axes;  // innermost first while merging
    std::int64_t size_a = 1;
    std::int64_t size_b = 1;
    for (int axis = 1; axis <= plan.shape.rank(); ++axis) {
        const std::int64_t extent = plan.shape[-axis];
        const std::int64_t extent_a = axis <= a.rank() ? a[-axis] : 1;
        const std::int64_t extent_b = axis <= b.rank() ? b[-axis] : 1;
        if (extent == 1) continue;
        const BroadcastPlan::Axis next{extent, extent_a == 1 ? 0 : size_a,
                                       extent_b == 1 ? 0 : size_b};
        size_a *= extent_a;
        size_b *= extent_b;
        const bool continues = !axes.empty() &&
                               (next.stride_a == 0) == (axes.back().stride_a == 0) &&
                               (next.stride_b == 0) == (axes.back().stride_b == 0);
        if (continues) {
            axes.back().extent *= extent;
        } else {
            axes.push_back(next);
        }
    }
    if (axes.empty()) axes.push_back({plan.shape.size(), 1, 1});
    plan.inner = axes.front();
    for (auto axis = axes.rbegin(); axis + 1 != axes.rend(); ++axis) {
        plan.outer.push_back(*axis);
        plan.outer_size *= axis->extent;
    }
    return plan;
}

Tensor add(const Tensor& a, const Tensor& b) {
    return zip(a, b, "add", [](auto x, auto y) { return x + y; });
}
Tensor subtract(const Tensor& a, const Tensor& b) {
    return zip(a, b, "subtract", [](auto x, auto y) { return x - y; });
}
Tensor multiply(const Tensor& a, const Tensor& b) {
    return zip(a, b, "multiply", [](auto x, auto y) { return x * y; });
}
Tensor divide(const Tensor& a, const Tensor& b) {
    return zip(a, b, "divide", [](auto x, auto y) { return x / y; });
}
Tensor maximum(const Tensor& a, const Tensor& b) {
    return zip(a, b, "maximum", [](auto x, auto y) { return at_least(x, y) ? x : y; });
}
Tensor minimum(const Tensor& a, const Tensor& b) {
    return zip(a, b, "minimum", [](auto x, auto y) { return at_most(x, y) ? x : y; });
}
Tensor takes_maximum(const Tensor& a, const Tensor& b) {
    return zip(a, b, "maximum",
               [](auto x, auto y) { return at_least(x, y) ? decltype(x)(1) : decltype(x)(0); });
}
Tensor takes_minimum(const Tensor& a, const Tensor& b) {
    return zip(a, b, "minimum",
               [](auto x, auto y) { return at_most(x, y) ? decltype(x)(1) : decltype(x)(0); });
}

Tensor affine(const Tensor& x, double factor, double offset) {
    return map(x, [=](auto value) {
        using T = decltype(value);
        return static_cast<T>(factor) * value + static_cast<T>(offset);
    });
}
Tensor exp(const Tensor& x) {
    return map(x, [](auto value) { return std::exp(value); });
}
Tensor log(const Tensor& x) {
    return map(x, [](auto value) { return std::log(value); });
}

namespace {

/// Calls body(x, y, count) with pointers for parts of all elements, on several threads.
template <class Body>
Tensor map_parts(const Tensor& x, const Body& body) {
    Tensor y(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        parallel_for(x.size(), elementwise_grain, [=](std::int64_t begin, std::int64_t end) {
            body(in + begin, out + begin, end - begin);
        });
    });
    return y;
}

}  // namespace

Tensor sin(const Tensor& x) {
    return map_parts(x, []<class T>(const T* in, T* out, std::int64_t count) {
        sine_cosine(in, out, static_cast<T*>(nullptr), count);
    });
}
Tensor cos(const Tensor& x) {
    return map_parts(x, []<class T>(const T* in, T* out, std::int64_t count) {
        sine_cosine(in, static_cast<T*>(nullptr), out, count);
    });
}

Tensor sqrt(const Tensor& x) {
    return map(x, [](auto value) { return std::sqrt(value); });
}
Tensor square(const Tensor& x) {
    return map(x, [](auto value) { return value * value; });
}
Tensor abs(const Tensor& x) {
    return map(x, [](auto value) { return std::abs(value); });
}
Tensor sign(const Tensor& x) {
    return map(x, [](auto value) {
        using T = decltype(value);
        return value > T(0) ? T(1) : (value < T(0) ? T(-1) : T(0));
    });
}
Tensor clamp(const Tensor& x, double low, double high) {
    return map(x, [=](auto value) {
        using T = decltype(value);
        const T bottom = static_cast<T>(low);
        const T top = static_cast<T>(high);
        return value < bottom ? bottom : (value > top ? top : value);
    });
}
Tensor where_within(const Tensor& x, const Tensor& selector, double low, double high) {
    return zip(x, selector, "where_within", [=](auto value, auto at) {
        using T = decltype(at);
        // Two choices without a branch between them, which vectorise.
        const T above = at >= static_cast<T>(low) ? value : T(0);
        return at <= static_cast<T>(high) ? above : T(0);
    });
}
Tensor select(const Tensor& condition, const Tensor& a, const Tensor& b) {
    Tensor result(a.shape(), a.dtype());
    dispatch(a.dtype(), [&]<class T>(T) {
        const T* const takes_a = condition.values<T>().data();
        const T* const from_a = a.values<T>().data();
        const T* const from_b = b.values<T>().data();
        T* const out = result.mutable_values<T>().data();
        parallel_for(a.size(), elementwise_grain, [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
            for (std::int64_t i = begin; i < end; ++i)
                out[i] = takes_a[i] != T(0) ? from_a[i] : from_b[i];
        });
    });
    return result;
}
Tensor nonzero(const Tensor& x) {
    return map(x, [](auto value) {
        using T = decltype(value);
        return value != T(0) ? T(1) : T(0);
    });
}

Tensor sigmoid(const Tensor& x) {
    return map(x, [](auto value) {
        using T = decltype(value);
        // The exponential of a negative argument only: never overflows, and keeps full precision in
        // both tails.
        const T e = std::exp(-std::abs(value));
        return (value >= T(0) ? T(1) : e) / (T(1) + e);
    });
}
Tensor tanh(const Tensor& x) {
    return map(x, [](auto value) { return std::tanh(value); });
}
Tensor softplus(const Tensor& x) {
    return map(x, [](auto value) {
        using T = decltype(value);
        return (value > T(0) ? value : T(0)) + std::log1p(std::exp(-std::abs(value)));
    });
}

namespace {

/// Choosing between constants lets the compiler use a vector blend; choosing between results would
/// branch.
template <class T>
T leaky_factor(T value, double slope) {
    return value > T(0) ? T(1) : static_cast<T>(slope);
}

}  // namespace

Tensor leaky_relu(const Tensor& x, double slope) {
    // 0 times an overflow would be NaN.
    if (slope == 0.0)
        return map(x, [](auto value) { return value <= 0 ? decltype(value)(0) : value; });
    return map(x, [=](auto value) { return value * leaky_factor(value, slope); });
}
Tensor leaky_gate(const Tensor& x, const Tensor& sign, double slope, double gain) {
    return zip(x, sign, "leaky_gate", [=](auto value, auto of) {
        return value * static_cast<decltype(of)>(gain) * leaky_factor(of, slope);
    });
}
Tensor prelu(const Tensor& x, const Tensor& slope) {
    return zip(x, slope, "prelu", [](auto value, auto factor) {
        return value > decltype(value)(0) ? value : factor * value;
    });
}
Tensor leaky_slope(const Tensor& x, double slope) {
    return map(x, [=](auto value) { return leaky_factor(value, slope); });
}

Tensor broadcast_to(const Tensor& x, const Shape& shape) {
    if (broadcast_shape(x.shape(), shape, "broadcast_to") != shape)
        fail<ShapeError>("[broadcast_to] ", x.shape(), " does not broadcast to ", shape);
    Tensor target(shape, x.dtype());
    const BroadcastPlan plan = plan_broadcast(x.shape(), shape, "broadcast_to");
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = target.mutable_values<T>().data();
        const std::int64_t length = plan.inner.extent;
        const std::int64_t grain =
            std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, length));
        parallel_for(plan.outer_size, grain, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t row = begin; row < end; ++row) {
                const T* from = in + plan.offsets(row).a;
                if (plan.inner.stride_a == 0) {
                    std::fill_n(out + row * length, length, *from);
                } else {
                    std::copy_n(from, length, out + row * length);
                }
            }
        });
    });
    return target;
}

}  // namespace stymo::kernels
