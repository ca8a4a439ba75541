#include "core/kernels/float16_product.h"

#include <algorithm>
#include <bit>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace stymo::kernels {

float widened(Float16 x) {
    const std::uint32_t sign = static_cast<std::uint32_t>(x.bits & 0x8000) << 16;
    const std::uint32_t rest = static_cast<std::uint32_t>(x.bits & 0x7FFF) << 13;
    // Subnormal numbers become right by the multiplication, infinity and NaN by the largest exponent.
    const float shifted = std::bit_cast<float>(rest) * 0x1p112F;
    const std::uint32_t special = rest >= 0x0F800000 ? 0x7F800000 : 0;
    return std::bit_cast<float>(std::bit_cast<std::uint32_t>(shifted) | sign | special);
}

Float16 rounded_to_float16(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const auto sign = bits >> 16 & 0x8000;
    const float size = std::bit_cast<float>(bits & 0x7FFFFFFF);
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

#if defined(__x86_64__)

namespace {

/// Products that a lane adds up in half precision. The error grows with their root, and so does the share of time that is not
/// spent on conversions.
constexpr std::int64_t pairs_at_once = 64;

/// Both sums of a lane's pair, for the even columns (a) and the odd ones (b): in the order of the columns.
__attribute__((target("avx512fp16,avx512vl"))) inline __m512h sums_of_pairs(__m512h a, __m512h b) {
    constexpr __mmask32 odd = 0xAAAAAAAA;
    const __m512i first = _mm512_mask_blend_epi16(odd, _mm512_castph_si512(a), _mm512_castph_si512(b));
    const __m512i second = _mm512_rol_epi32(_mm512_mask_blend_epi16(odd, _mm512_castph_si512(b), _mm512_castph_si512(a)), 16);
    return _mm512_add_ph(_mm512_castsi512_ph(first), _mm512_castsi512_ph(second));
}

template <int rows>
__attribute__((target("avx512fp16,avx512vl"))) void multiply_rows(const Float16Block& block) {
    const float* start = block.start;
    std::int64_t start_stride = block.start_stride;
    for (std::int64_t begin = 0; begin == 0 || begin < block.pairs; begin += pairs_at_once) {
        const std::int64_t count = std::min(pairs_at_once, block.pairs - begin);
        __m512h sums[rows][2];
#pragma GCC unroll 12
        for (int row = 0; row < rows; ++row) sums[row][0] = sums[row][1] = _mm512_setzero_ph();
        // A pointer for three rows each, not derived from one another: else there are not registers enough for distances.
        const Float16* left0 = block.left + 2 * begin;
        const Float16* left3 = left0 + 3 * block.row_stride;
        const Float16* left6 = left0 + 6 * block.row_stride;
        const Float16* left9 = left0 + 9 * block.row_stride;
        const Float16* panel = block.panel + begin * block.panel_stride;
        for (std::int64_t i = 0; i < count; ++i) {
            const __m512h even = _mm512_loadu_ph(panel), odd = _mm512_loadu_ph(panel + float16_columns);
#pragma GCC unroll 12
            for (int row = 0; row < rows; ++row) {
                const Float16* const left = row < 3 ? left0 : row < 6 ? left3 : row < 9 ? left6 : left9;
                std::int32_t pair = 0;
                std::memcpy(&pair, left + row % 3 * block.row_stride, sizeof(pair));
                const __m512h factor = _mm512_castsi512_ph(_mm512_set1_epi32(pair));
                sums[row][0] = _mm512_fmadd_ph(factor, even, sums[row][0]);
                sums[row][1] = _mm512_fmadd_ph(factor, odd, sums[row][1]);
            }
            left0 += 2;
            left3 += 2;
            left6 += 2;
            left9 += 2;
            __asm__("" : "+r"(left0), "+r"(left3), "+r"(left6), "+r"(left9));
            panel += block.panel_stride;
        }
#pragma GCC unroll 12
        for (int row = 0; row < rows; ++row) {
            const __m512i both = _mm512_castph_si512(sums_of_pairs(sums[row][0], sums[row][1]));
            const __m512 lower = _mm512_cvtxph_ps(_mm256_castsi256_ph(_mm512_castsi512_si256(both)));
            const __m512 upper = _mm512_cvtxph_ps(_mm256_castsi256_ph(_mm512_extracti64x4_epi64(both, 1)));
            const float* const from = start + row * start_stride;
            float* const to = block.sums + row * block.sums_stride;
            _mm512_storeu_ps(to, _mm512_add_ps(_mm512_loadu_ps(from), lower));
            _mm512_storeu_ps(to + 16, _mm512_add_ps(_mm512_loadu_ps(from + 16), upper));
        }
        start = block.sums;
        start_stride = block.sums_stride;
    }
}

}  // namespace

bool multiplies_float16() {
    static const bool supported = __builtin_cpu_supports("avx512fp16") != 0;
    return supported;
}

void multiply_float16_block(int rows, const Float16Block& block) {
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

#else

bool multiplies_float16() {
    return false;
}

void multiply_float16_block(int, const Float16Block&) {}

#endif

}  // namespace stymo::kernels
