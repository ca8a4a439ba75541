// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_EPILOGUE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_EPILOGUE_INL_H
#undef STYMO_CORE_KERNELS_EPILOGUE_INL_H
#else
#define STYMO_CORE_KERNELS_EPILOGUE_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/kernels/gemm.h"
#include "core/kernels/sine-inl.h"

/// The activation after a product, on blocks that are still in the first-level cache.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

/// `rows` rows of whole vectors: the sums, and the destinations of the results and the slopes
/// (null: no slopes).
template <class T>
struct Activated {
    const T* sums;
    std::int64_t sums_stride;
    T* c;
    T* slope;
    std::int64_t stride;  ///< of c and of slope
    std::int64_t rows;
    std::int64_t columns;
};

template <class T>
HWY_INLINE void for_each_vector(const Activated<T>& block, auto body) {
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(simd::ScalableTag<T>()));
    for (std::int64_t row = 0; row < block.rows; ++row) {
        for (std::int64_t column = 0; column < block.columns; column += lanes)
            body(block.sums + row * block.sums_stride + column, row * block.stride + column);
    }
}

/// The standard library's sine where the vector sine is not accurate: float32 beyond its limit and
/// NaN, and all of float64.
template <class T>
HWY_NOINLINE void apply_library_sine(const Activated<T>& block) {
    for (std::int64_t row = 0; row < block.rows; ++row) {
        for (std::int64_t column = 0; column < block.columns; ++column) {
            const T x = block.sums[row * block.sums_stride + column];
            if (sizeof(T) == sizeof(float) && std::abs(x) <= static_cast<T>(vector_sine_limit))
                continue;
            const std::int64_t index = row * block.stride + column;
            block.c[index] = std::sin(x);
            if (block.slope != nullptr) block.slope[index] = std::cos(x);
        }
    }
}

HWY_INLINE void apply_sine(const Activated<float>& block) {
    const simd::ScalableTag<float> tag;
    // The sum of squares detects numbers beyond the limit with one instruction for each vector.
    auto squares = simd::Zero(tag);
    const auto add = [&](const float* sums, std::int64_t index, bool with_slope) {
        const auto x = simd::LoadU(tag, sums);
        squares = simd::MulAdd(x, x, squares);
        const auto turns = reduce_half_turns(x);
        simd::StoreU(vector_sine(turns), tag, block.c + index);
        if (with_slope) simd::StoreU(vector_cosine(turns), tag, block.slope + index);
    };
    if (block.slope == nullptr) {
        for_each_vector(block,
                        [&](const float* sums, std::int64_t index) { add(sums, index, false); });
    } else {
        for_each_vector(block,
                        [&](const float* sums, std::int64_t index) { add(sums, index, true); });
    }
    if (!simd::AllTrue(tag,
                       simd::Le(squares, simd::Set(tag, vector_sine_limit * vector_sine_limit))))
        apply_library_sine(block);
}

HWY_INLINE void apply_sine(const Activated<double>& block) {
    apply_library_sine(block);
}

template <class T>
HWY_INLINE void apply_leaky_relu(const Activated<T>& block) {
    const simd::ScalableTag<T> tag;
    const auto gain = simd::Set(tag, static_cast<T>(std::numbers::sqrt2));
    const auto leak = simd::Set(tag, static_cast<T>(std::numbers::sqrt2) * static_cast<T>(0.2));
    for_each_vector(block, [&](const T* sums, std::int64_t index) {
        const auto x = simd::LoadU(tag, sums);
        const auto factor = simd::IfThenElse(simd::Gt(x, simd::Zero(tag)), gain, leak);
        simd::StoreU(simd::Mul(x, factor), tag, block.c + index);
        if (block.slope != nullptr) simd::StoreU(factor, tag, block.slope + index);
    });
}

/// Applies the activation. The sums must not overlap the results.
template <class T>
HWY_INLINE void activate(const Activated<T>& block, Activation activation) {
    switch (activation) {
        case Activation::sine: apply_sine(block); return;
        case Activation::leaky_relu: apply_leaky_relu(block); return;
        case Activation::none: break;
    }
    const simd::ScalableTag<T> tag;
    for_each_vector(block, [&](const T* sums, std::int64_t index) {
        simd::StoreU(simd::LoadU(tag, sums), tag, block.c + index);
        if (block.slope != nullptr) simd::StoreU(simd::Set(tag, T(1)), tag, block.slope + index);
    });
}

/// Applies the activation to a block and writes only its first `columns` columns. `sums` has
/// `computed` columns, which are whole vectors. The block has at most `most_rows` rows and `width`
/// columns.
template <std::int64_t most_rows, std::int64_t width, class T>
HWY_INLINE void finish_block(Activated<T> block, std::int64_t computed, Activation activation) {
    if (block.columns == computed) {
        activate(block, activation);
        return;
    }
    std::array<T, static_cast<std::size_t>(most_rows * width)> results;
    std::array<T, static_cast<std::size_t>(most_rows * width)> slopes;
    activate(
        Activated<T>{block.sums, block.sums_stride, results.data(),
                     block.slope == nullptr ? nullptr : slopes.data(), width, block.rows, computed},
        activation);
    for (std::int64_t i = 0; i < block.rows; ++i) {
        std::copy_n(results.data() + i * width, block.columns, block.c + i * block.stride);
        if (block.slope != nullptr)
            std::copy_n(slopes.data() + i * width, block.columns, block.slope + i * block.stride);
    }
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
