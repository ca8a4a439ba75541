#pragma once

#include <cmath>
#include <cstdint>

/// Sine and cosine that the compiler can vectorise.
namespace stymo::kernels {

/// Largest |x| for which the three-part reduction below keeps float32 accuracy.
inline constexpr float vector_sine_limit = 8192.0F;

struct SineCosine {
    float sine;
    float cosine;
};

/// Both at once, absolute error below 1e-7 for |x| <= vector_sine_limit. Cody-Waite reduction by pi/2 in three parts and
/// the minimax polynomials of the Cephes library (Moshier) on [-pi/4, pi/4]; no branches.
inline SineCosine vector_sine_cosine(float x) {
    const float quadrant = std::nearbyint(x * 0.636619772F);
    float r = x - quadrant * 1.5703125F;
    r -= quadrant * 4.837512969970703125e-4F;
    r -= quadrant * 7.54978995489188216e-8F;
    const float r2 = r * r;
    const float sine = r + r * r2 * (-1.6666654611e-1F + r2 * (8.3321608736e-3F + r2 * -1.9515295891e-4F));
    const float cosine =
        1.0F - 0.5F * r2 + r2 * r2 * (4.166664568298827e-2F + r2 * (-1.388731625493765e-3F + r2 * 2.443315711809948e-5F));
    const auto index = static_cast<std::int32_t>(quadrant);
    const bool swap = (index & 1) != 0;
    const float s = swap ? cosine : sine;
    const float c = swap ? sine : cosine;
    return {(index & 2) != 0 ? -s : s, ((index + 1) & 2) != 0 ? -c : c};
}

inline bool within_vector_sine_limit(const float* x, std::int64_t count) {
    int outside = 0;  // not a bool, whose reduction is not vectorised
#pragma omp simd reduction(| : outside)
    for (std::int64_t i = 0; i < count; ++i) outside |= std::abs(x[i]) <= vector_sine_limit ? 0 : 1;
    return outside == 0;
}

/// Calls store(i, sin x_i, cos x_i) for all i: by the vector form where every argument of a block allows it, else (large
/// arguments, NaN, float64) by the standard library. NaN fails the comparison and so takes the exact path too.
template <class T, class Store>
void for_each_sine_cosine(const T* x, std::int64_t count, Store store) {
    constexpr std::int64_t block = 256;
    for (std::int64_t begin = 0; begin < count; begin += block) {
        const std::int64_t end = begin + block < count ? begin + block : count;
        if constexpr (sizeof(T) == sizeof(float)) {
            if (within_vector_sine_limit(x + begin, end - begin)) {
#pragma omp simd
                for (std::int64_t i = begin; i < end; ++i) {
                    const SineCosine value = vector_sine_cosine(x[i]);
                    store(i, value.sine, value.cosine);
                }
                continue;
            }
        }
        for (std::int64_t i = begin; i < end; ++i) store(i, std::sin(x[i]), std::cos(x[i]));
    }
}

}  // namespace stymo::kernels
