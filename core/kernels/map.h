#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/tensor.h"

/// Loops over one or two tensors, for the kernels' own use.
namespace stymo::kernels {

/// Elements in one chunk of an elementwise loop: large enough to hide the cost of a thread, small
/// enough to balance.
inline constexpr std::int64_t elementwise_grain = 16384;

template <class Function>
Tensor map(const Tensor& x, Function function) {
    Tensor y(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        parallel_for(x.size(), elementwise_grain, [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
            for (std::int64_t i = begin; i < end; ++i) out[i] = function(in[i]);
        });
    });
    return y;
}

/// How two broadcast operands are traversed: axes are merged as far as possible, and each has the
/// strides of both operands (0 if the operand repeats).
struct BroadcastPlan {
    struct Axis {
        std::int64_t extent = 1;
        std::int64_t stride_a = 0;
        std::int64_t stride_b = 0;
    };
    Shape shape;
    std::vector<Axis> outer;
    Axis inner;
    std::int64_t outer_size = 1;

    struct Offsets {
        std::int64_t a = 0;
        std::int64_t b = 0;
    };
    [[nodiscard]] Offsets offsets(std::int64_t outer_index) const {
        Offsets result;
        for (auto axis = outer.rbegin(); axis != outer.rend(); ++axis) {
            const std::int64_t i = outer_index % axis->extent;
            outer_index /= axis->extent;
            result.a += i * axis->stride_a;
            result.b += i * axis->stride_b;
        }
        return result;
    }
};

[[nodiscard]] BroadcastPlan plan_broadcast(const Shape& a, const Shape& b, const char* operation);

template <class T, class Function>
void zip_row(const T* a, const T* b, T* out, const BroadcastPlan::Axis& axis, std::int64_t begin,
             std::int64_t end, Function function) {
    if (axis.stride_a == 0) {
#pragma omp simd
        for (std::int64_t i = begin; i < end; ++i) out[i] = function(a[0], b[i]);
    } else if (axis.stride_b == 0) {
#pragma omp simd
        for (std::int64_t i = begin; i < end; ++i) out[i] = function(a[i], b[0]);
    } else {
#pragma omp simd
        for (std::int64_t i = begin; i < end; ++i) out[i] = function(a[i], b[i]);
    }
}

template <class Function>
Tensor zip(const Tensor& a, const Tensor& b, const char* operation, Function function) {
    if (a.dtype() != b.dtype())
        fail<TypeError>("[", operation, "] operands are ", a.dtype(), " and ", b.dtype());
    const BroadcastPlan plan = plan_broadcast(a.shape(), b.shape(), operation);
    Tensor result(plan.shape, a.dtype());
    dispatch(a.dtype(), [&]<class T>(T) {
        const T* in_a = a.values<T>().data();
        const T* in_b = b.values<T>().data();
        T* out = result.mutable_values<T>().data();
        const std::int64_t length = plan.inner.extent;
        if (plan.outer.empty()) {
            parallel_for(length, elementwise_grain, [&](std::int64_t begin, std::int64_t end) {
                zip_row(in_a, in_b, out, plan.inner, begin, end, function);
            });
            return;
        }
        const std::int64_t grain =
            std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, length));
        parallel_for(plan.outer_size, grain, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t row = begin; row < end; ++row) {
                const auto offset = plan.offsets(row);
                zip_row(in_a + offset.a, in_b + offset.b, out + row * length, plan.inner, 0, length,
                        function);
            }
        });
    });
    return result;
}

}  // namespace stymo::kernels
