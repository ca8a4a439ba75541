#include "core/kernels/matmul.h"
#include "core/kernels/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/dots.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

/// `rows` x `others` inner products of contiguous vectors.
template <class T, int rows, int others>
HWY_INLINE void multiply_dots_block(const Dots<T>& dots) {
    const simd::ScalableTag<T> tag;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    simd::Vec<simd::ScalableTag<T>> sums[rows][others];
    HWY_UNROLL(4)
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < others; ++j) sums[i][j] = simd::Zero(tag);
    }
    const std::int64_t whole = dots.k / lanes * lanes;
    for (std::int64_t p = 0; p < whole; p += lanes) {
        simd::Vec<simd::ScalableTag<T>> y[others];
        for (int j = 0; j < others; ++j) y[j] = simd::LoadU(tag, dots.y + j * dots.k + p);
        HWY_UNROLL(4)
        for (int i = 0; i < rows; ++i) {
            const auto x = simd::LoadU(tag, dots.x + i * dots.k + p);
            for (int j = 0; j < others; ++j) sums[i][j] = simd::MulAdd(x, y[j], sums[i][j]);
        }
    }
    HWY_UNROLL(4)
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < others; ++j) {
            T sum = simd::GetLane(simd::SumOfLanes(tag, sums[i][j]));
            for (std::int64_t p = whole; p < dots.k; ++p)
                sum += dots.x[i * dots.k + p] * dots.y[j * dots.k + p];
            dots.c[i * dots.stride_x + j * dots.stride_y] = sum;
        }
    }
}

template <class T, int others>
void multiply_dots_with(Dots<T> dots) {
    const auto advance = [&](std::int64_t rows) {
        dots.x += rows * dots.k;
        dots.c += rows * dots.stride_x;
        dots.count_x -= rows;
    };
    for (; dots.count_x >= 4; advance(4)) multiply_dots_block<T, 4, others>(dots);
    for (; dots.count_x > 0; advance(1)) multiply_dots_block<T, 1, others>(dots);
}

template <class T>
void multiply_dots_of(Dots<T> dots) {
    while (dots.count_y > 0) {
        const std::int64_t others = dots.count_y > 3 ? 4 : dots.count_y;
        if (others == 4) multiply_dots_with<T, 4>(dots);
        if (others == 3) multiply_dots_with<T, 3>(dots);
        if (others == 2) multiply_dots_with<T, 2>(dots);
        if (others == 1) multiply_dots_with<T, 1>(dots);
        dots.y += others * dots.k;
        dots.c += others * dots.stride_y;
        dots.count_y -= others;
    }
}

void multiply_float_dots(const Dots<float>& dots) {
    multiply_dots_of(dots);
}

void multiply_double_dots(const Dots<double>& dots) {
    multiply_dots_of(dots);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(multiply_float_dots);
HWY_EXPORT(multiply_double_dots);

template <>
void multiply_dots(const Dots<float>& dots) {
    HWY_DYNAMIC_DISPATCH(multiply_float_dots)(dots);
}

template <>
void multiply_dots(const Dots<double>& dots) {
    HWY_DYNAMIC_DISPATCH(multiply_double_dots)(dots);
}

}  // namespace stymo::kernels
#endif
