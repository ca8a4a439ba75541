#include "core/kernels/peak.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/clock.h"
#include "core/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/peak.cpp"
// Highway 1.0.3 forgets this set where it is the compiler's own baseline.
#define HWY_WANT_AVX3_DL
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#if HWY_ARCH_X86_64
#include <immintrin.h>
#endif

HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// `rounds` of twelve independent chains, enough to fill the pipelines of known processors. Returns operations done; `sink` keeps
/// the compiler from leaving them out.
double multiply_adds(std::int64_t rounds, float& sink) {
    const hn::ScalableTag<float> d;
    const auto factor = hn::Set(d, 0.999F), addend = hn::Set(d, 0.001F);
    auto a0 = hn::Set(d, 1.0F), a1 = a0, a2 = a0, a3 = a0, a4 = a0, a5 = a0;
    auto a6 = a0, a7 = a0, a8 = a0, a9 = a0, a10 = a0, a11 = a0;
    for (std::int64_t i = 0; i < rounds; ++i) {
        a0 = hn::MulAdd(a0, factor, addend);
        a1 = hn::MulAdd(a1, factor, addend);
        a2 = hn::MulAdd(a2, factor, addend);
        a3 = hn::MulAdd(a3, factor, addend);
        a4 = hn::MulAdd(a4, factor, addend);
        a5 = hn::MulAdd(a5, factor, addend);
        a6 = hn::MulAdd(a6, factor, addend);
        a7 = hn::MulAdd(a7, factor, addend);
        a8 = hn::MulAdd(a8, factor, addend);
        a9 = hn::MulAdd(a9, factor, addend);
        a10 = hn::MulAdd(a10, factor, addend);
        a11 = hn::MulAdd(a11, factor, addend);
    }
    const auto low = hn::Add(hn::Add(hn::Add(a0, a1), hn::Add(a2, a3)), hn::Add(a4, a5));
    const auto high = hn::Add(hn::Add(hn::Add(a6, a7), hn::Add(a8, a9)), hn::Add(a10, a11));
    sink += hn::GetLane(hn::SumOfLanes(d, hn::Add(low, high)));
    return 2.0 * 12.0 * static_cast<double>(hn::Lanes(d)) * static_cast<double>(rounds);
}

/// a = b + 2 c for multiples of the vector's length. Streaming stores: reading a first would be a fourth of the traffic.
void triad(float* a, const float* b, const float* c, std::int64_t count) {
    const hn::ScalableTag<float> d;
    const auto factor = hn::Set(d, 2.0F);
    for (std::int64_t i = 0; i < count; i += static_cast<std::int64_t>(hn::Lanes(d)))
        hn::Stream(hn::MulAdd(hn::Load(d, c + i), factor, hn::Load(d, b + i)), d, a + i);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <hwy/aligned_allocator.h>

namespace stymo::kernels {
namespace {

HWY_EXPORT(multiply_adds);
HWY_EXPORT(triad);

#if HWY_ARCH_X86_64
// Highway 1.0 has no set of instructions with these dot products.
__attribute__((target("avx512f,avx512bw,avx512vl,avx512bf16"))) double dot_products(std::int64_t rounds, float& sink) {
    __m512 a0 = _mm512_set1_ps(1.0F), a1 = a0, a2 = a0, a3 = a0, a4 = a0, a5 = a0;
    __m512 a6 = a0, a7 = a0, a8 = a0, a9 = a0, a10 = a0, a11 = a0;
    const __m512bh x = _mm512_cvtne2ps_pbh(a0, a0);
    for (std::int64_t i = 0; i < rounds; ++i) {
        a0 = _mm512_dpbf16_ps(a0, x, x);
        a1 = _mm512_dpbf16_ps(a1, x, x);
        a2 = _mm512_dpbf16_ps(a2, x, x);
        a3 = _mm512_dpbf16_ps(a3, x, x);
        a4 = _mm512_dpbf16_ps(a4, x, x);
        a5 = _mm512_dpbf16_ps(a5, x, x);
        a6 = _mm512_dpbf16_ps(a6, x, x);
        a7 = _mm512_dpbf16_ps(a7, x, x);
        a8 = _mm512_dpbf16_ps(a8, x, x);
        a9 = _mm512_dpbf16_ps(a9, x, x);
        a10 = _mm512_dpbf16_ps(a10, x, x);
        a11 = _mm512_dpbf16_ps(a11, x, x);
    }
    const __m512 low = _mm512_add_ps(_mm512_add_ps(_mm512_add_ps(a0, a1), _mm512_add_ps(a2, a3)), _mm512_add_ps(a4, a5));
    const __m512 high = _mm512_add_ps(_mm512_add_ps(_mm512_add_ps(a6, a7), _mm512_add_ps(a8, a9)), _mm512_add_ps(a10, a11));
    sink += _mm512_cvtss_f32(_mm512_add_ps(low, high));
    return 2.0 * 12.0 * 32.0 * static_cast<double>(rounds);
}
bool has_dot_products() {
    return __builtin_cpu_supports("avx512bf16") != 0;
}
#else
double dot_products(std::int64_t, float&) {
    return 0.0;
}
bool has_dot_products() {
    return false;
}
#endif

constexpr int runs = 8;
/// Of each thread and run: short enough for many runs, so that one of them goes undisturbed.
constexpr std::int64_t parts = 16;
constexpr std::int64_t rounds_of_part = 40000;
constexpr std::int64_t triad_length = std::int64_t{1} << 24;
constexpr std::int64_t triad_part = std::int64_t{1} << 16;

template <class Function>
double shortest_seconds(Function function) {
    function();
    double shortest = 0.0;
    for (int run = 0; run < runs; ++run) {
        const double start = seconds_now();
        function();
        const double seconds = seconds_now() - start;
        shortest = run == 0 ? seconds : std::min(shortest, seconds);
    }
    return shortest;
}

/// `chains(rounds, sink)` does some rounds and returns the operations of them.
template <class Chains>
double operations_per_second(Chains chains) {
    const std::int64_t count = parts * thread_count();
    std::vector<double> operations(static_cast<std::size_t>(count));
    std::vector<float> sinks(static_cast<std::size_t>(count));
    const double seconds = shortest_seconds([&] {
        parallel_for(count, 1, [&](std::int64_t begin, std::int64_t) {
            const auto part = static_cast<std::size_t>(begin);
            operations[part] = chains(rounds_of_part, sinks[part]);
        });
    });
    double total = 0.0;
    for (const double part : operations) total += part;
    return total / seconds;
}

double triad_bytes_per_second() {
    const auto length = static_cast<std::size_t>(triad_length);
    const auto a = hwy::AllocateAligned<float>(length), b = hwy::AllocateAligned<float>(length),
               c = hwy::AllocateAligned<float>(length);
    std::fill_n(b.get(), length, 1.0F);
    std::fill_n(c.get(), length, 1.0F);
    const double seconds = shortest_seconds([&] {
        parallel_for(triad_length, triad_part, [&](std::int64_t begin, std::int64_t end) {
            HWY_DYNAMIC_DISPATCH(triad)(a.get() + begin, b.get() + begin, c.get() + begin, end - begin);
        });
    });
    return 3.0 * sizeof(float) * static_cast<double>(triad_length) / seconds;
}

}  // namespace

MachinePeak measure_peak() {
    MachinePeak peak;
    peak.float32_flops =
        operations_per_second([](std::int64_t rounds, float& sink) { return HWY_DYNAMIC_DISPATCH(multiply_adds)(rounds, sink); });
    if (has_dot_products()) peak.bfloat16_flops = operations_per_second(dot_products);
    peak.triad_bytes = triad_bytes_per_second();
    return peak;
}

}  // namespace stymo::kernels
#endif
