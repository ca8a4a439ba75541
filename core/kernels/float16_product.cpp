#include "core/kernels/float16_product.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numbers>

#include "core/kernels/targets.h"

// Clang does not know the name of the feature before version 16.
#if defined(__x86_64__) && !(defined(__clang__) && __clang_major__ < 16)
#include <immintrin.h>
#define STYMO_HAS_FLOAT16
#endif

namespace stymo::kernels {

float widened(Float16 x) {
    const std::uint32_t sign = static_cast<std::uint32_t>(x.bits & 0x8000) << 16;
    const std::uint32_t rest = static_cast<std::uint32_t>(x.bits & 0x7FFF) << 13;
    // The multiplication also converts subnormal numbers. Infinity and NaN need the largest
    // exponent.
    const float shifted = std::bit_cast<float>(rest) * 0x1p112F;
    const std::uint32_t special = rest >= 0x0F800000 ? 0x7F800000 : 0;
    return std::bit_cast<float>(std::bit_cast<std::uint32_t>(shifted) | sign | special);
}

Float16 rounded_to_float16(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const auto sign = bits >> 16 & 0x8000;
    const auto size = std::bit_cast<float>(bits & 0x7FFFFFFF);
    std::uint32_t result = 0;
    if (!(size == size)) {
        result = 0x7E00;
    } else if (size >= 65520.0F) {
        result = 0x7C00;
    } else if (size < 0x1p-14F) {
        // The sum's last bit is the last one of subnormal numbers.
        result = std::bit_cast<std::uint32_t>(size + 0.5F) - std::bit_cast<std::uint32_t>(0.5F);
    } else {
        const std::uint32_t of_size = bits & 0x7FFFFFFF;
        result = (of_size + 0xFFF + (of_size >> 13 & 1) - 0x38000000) >> 13;
    }
    return {static_cast<std::uint16_t>(sign | result)};
}

#ifdef STYMO_HAS_FLOAT16

namespace {

/// Both sums of a lane's pair, for the even columns (a) and the odd ones (b): in the order of the
/// columns.
__attribute__((target("avx512fp16,avx512vl"))) inline __m512h sums_of_pairs(__m512h a, __m512h b) {
    constexpr __mmask32 odd = 0xAAAAAAAA;
    const __m512i first =
        _mm512_mask_blend_epi16(odd, _mm512_castph_si512(a), _mm512_castph_si512(b));
    const __m512i second = _mm512_maskz_rol_epi32(
        0xFFFF, _mm512_mask_blend_epi16(odd, _mm512_castph_si512(b), _mm512_castph_si512(a)), 16);
    return _mm512_add_ph(_mm512_castsi512_ph(first), _mm512_castsi512_ph(second));
}

template <int rows>
using PairSums = __m512h[rows][2];

/// Sums of `count` pairs from pair `begin` on, in half precision.
template <int rows>
__attribute__((target("avx512fp16,avx512vl"), always_inline)) inline void sum_pairs(
    PairSums<rows>& sums, const Float16Operands& operands, std::int64_t begin, std::int64_t count) {
#pragma GCC unroll 12
    for (int row = 0; row < rows; ++row) sums[row][0] = sums[row][1] = _mm512_setzero_ph();
    // One pointer for every three rows, not derived from one another, because there are not enough
    // registers for offsets.
    const Float16* left0 = operands.left + 2 * begin;
    const Float16* left3 = left0 + 3 * operands.row_stride;
    const Float16* left6 = left0 + 6 * operands.row_stride;
    const Float16* left9 = left0 + 9 * operands.row_stride;
    const Float16* panel = operands.panel + begin * operands.panel_stride;
    for (std::int64_t i = 0; i < count; ++i) {
        const __m512h even = _mm512_loadu_ph(panel), odd = _mm512_loadu_ph(panel + float16_columns);
#pragma GCC unroll 12
        for (int row = 0; row < rows; ++row) {
            const Float16* const left = row < 3 ? left0 : row < 6 ? left3 : row < 9 ? left6 : left9;
            std::int32_t pair = 0;
            std::memcpy(&pair, left + row % 3 * operands.row_stride, sizeof(pair));
            const __m512h factor = _mm512_castsi512_ph(_mm512_set1_epi32(pair));
            sums[row][0] = _mm512_fmadd_ph(factor, even, sums[row][0]);
            sums[row][1] = _mm512_fmadd_ph(factor, odd, sums[row][1]);
        }
        left0 += 2;
        left3 += 2;
        left6 += 2;
        left9 += 2;
        __asm__("" : "+r"(left0), "+r"(left3), "+r"(left6), "+r"(left9));
        panel += operands.panel_stride;
    }
}

template <int rows>
__attribute__((target("avx512fp16,avx512vl"))) void multiply_rows(const Float16Block& block) {
    const float* start = block.start;
    std::int64_t start_stride = block.start_stride;
    for (std::int64_t begin = 0; begin == 0 || begin < block.operands.pairs;
         begin += float16_pairs_at_once) {
        PairSums<rows> sums;
        sum_pairs<rows>(sums, block.operands, begin,
                        std::min(float16_pairs_at_once, block.operands.pairs - begin));
#pragma GCC unroll 12
        for (int row = 0; row < rows; ++row) {
            // Masked forms with all lanes, because gcc warns about uninitialised operands of the
            // plain forms.
            const __m512i both = _mm512_castph_si512(sums_of_pairs(sums[row][0], sums[row][1]));
            const __m512 lower = _mm512_cvtxph_ps(
                _mm256_castsi256_ph(_mm512_maskz_extracti64x4_epi64(0xF, both, 0)));
            const __m512 upper = _mm512_cvtxph_ps(
                _mm256_castsi256_ph(_mm512_maskz_extracti64x4_epi64(0xF, both, 1)));
            const float* const from = start + row * start_stride;
            float* const to = block.sums + row * block.sums_stride;
            _mm512_storeu_ps(to, _mm512_add_ps(_mm512_loadu_ps(from), lower));
            _mm512_storeu_ps(to + 16, _mm512_add_ps(_mm512_loadu_ps(from + 16), upper));
        }
        start = block.sums;
        start_stride = block.sums_stride;
    }
}

/// A factor as the sum of a half and a remainder. Rounding it to a half would give every layer the
/// same error of the gain.
struct ExactFactor {
    __m512h nearest;
    __m512h rest;
};

__attribute__((target("avx512fp16,avx512vl"), always_inline)) inline ExactFactor exact_factor(
    float factor) {
    const float nearest = widened(rounded_to_float16(factor));
    return {_mm512_set1_ph(static_cast<_Float16>(nearest)),
            _mm512_set1_ph(static_cast<_Float16>(factor - nearest))};
}

__attribute__((target("avx512fp16,avx512vl"), always_inline)) inline __m512h times(
    __m512h x, const ExactFactor& factor) {
    return _mm512_fmadd_ph(x, factor.nearest, _mm512_mul_ph(x, factor.rest));
}

template <int rows>
__attribute__((target("avx512fp16,avx512vl"))) void multiply_rows(const Float16Layer& layer) {
    PairSums<rows> sums;
    sum_pairs<rows>(sums, layer.operands, 0, layer.operands.pairs);
    const __m256h lower = _mm512_cvtxps_ph(_mm512_loadu_ps(layer.bias)),
                  upper = _mm512_cvtxps_ph(_mm512_loadu_ps(layer.bias + 16));
    const __m512h bias = _mm512_castsi512_ph(_mm512_maskz_inserti64x4(
        0xFF, _mm512_castsi256_si512(_mm256_castph_si256(lower)), _mm256_castph_si256(upper), 1));
    const ExactFactor gain = exact_factor(std::numbers::sqrt2_v<float>),
                      leak = exact_factor(std::numbers::sqrt2_v<float> * 0.2F);
#pragma GCC unroll 12
    for (int row = 0; row < rows; ++row) {
        __m512h x = _mm512_add_ph(sums_of_pairs(sums[row][0], sums[row][1]), bias);
        if (layer.leaky_relu) x = _mm512_max_ph(times(x, gain), times(x, leak));
        _mm512_storeu_ph(layer.out + row * layer.out_stride, x);
    }
}

template <class Block>
void multiply_block(int rows, const Block& block) {
    switch (rows) {
        case 12:
            multiply_rows<12>(block);
            return;
        case 8:
            multiply_rows<8>(block);
            return;
        case 4:
            multiply_rows<4>(block);
            return;
        case 2:
            multiply_rows<2>(block);
            return;
        default:
            multiply_rows<1>(block);
    }
}

}  // namespace

bool multiplies_float16() {
    static const bool supported =
        __builtin_cpu_supports("avx512fp16") != 0 && allows_newest_instructions();
    return supported;
}

void multiply_float16_block(int rows, const Float16Block& block) {
    multiply_block(rows, block);
}

void multiply_float16_layer(int rows, const Float16Layer& layer) {
    multiply_block(rows, layer);
}

#else

bool multiplies_float16() {
    return false;
}

void multiply_float16_block(int, const Float16Block&) {}

void multiply_float16_layer(int, const Float16Layer&) {}

#endif

}  // namespace stymo::kernels
