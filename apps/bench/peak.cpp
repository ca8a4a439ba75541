#include "apps/bench/peak.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/clock.h"
#include "core/kernels/targets.h"
#include "core/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apps/bench/peak.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

using Vector = simd::Vec<simd::ScalableTag<float>>;

/// Multiplies numbers of float32.
struct Products {
    static constexpr std::int64_t per_lane = 1;
    static HWY_INLINE Vector multiply_add(Vector left, Vector right, Vector sum) {
        return simd::MulAdd(left, right, sum);
    }
};

#if HWY_ARCH_X86 && HWY_MAX_BYTES == 64
/// Multiplies pairs of bfloat16, which Highway 1.0 does not support.
struct DotProducts {
    static constexpr std::int64_t per_lane = 2;
    static HWY_INLINE Vector multiply_add(Vector left, Vector right, Vector sum) {
        __asm__("vdpbf16ps %2, %1, %0" : "+v"(sum.raw) : "v"(left.raw), "v"(right.raw));
        return sum;
    }
};
#endif

/// Independent chains of one thread; returns the number of operations done. `result` keeps them
/// from being optimised away.
template <class Instruction>
double run_chains(std::int64_t length, float* result) {
    constexpr int chains = 12;
    const simd::ScalableTag<float> tag;
    const Vector left = simd::Zero(tag), right = left;
    Vector sums[chains];
    // Different start values, since the compiler would merge equal chains.
    HWY_UNROLL(12)
    for (int i = 0; i < chains; ++i) sums[i] = simd::Set(tag, static_cast<float>(i));
    for (std::int64_t step = 0; step < length; ++step) {
        HWY_UNROLL(12)
        for (int i = 0; i < chains; ++i) sums[i] = Instruction::multiply_add(left, right, sums[i]);
    }
    auto total = simd::Zero(tag);
    HWY_UNROLL(12)
    for (int i = 0; i < chains; ++i) total = simd::Add(total, sums[i]);
    *result = simd::GetLane(simd::SumOfLanes(tag, total));
    return 2.0 * static_cast<double>(length * chains * static_cast<std::int64_t>(simd::Lanes(tag)) *
                                     Instruction::per_lane);
}

/// 0 without the instruction.
double run_chains_of(NumberFormat number, std::int64_t length, float* result) {
    if (number == NumberFormat::float32) return run_chains<Products>(length, result);
#if HWY_ARCH_X86 && HWY_MAX_BYTES == 64
    if (__builtin_cpu_supports("avx512bf16")) return run_chains<DotProducts>(length, result);
#endif
    return 0.0;
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(run_chains_of);

namespace {

/// Operations per second of chains on every thread.
double rate_of(NumberFormat number) {
    constexpr std::int64_t length = 4'000'000;
    const std::int64_t threads = thread_count();
    std::vector<double> work(static_cast<std::size_t>(threads));
    std::vector<float> results(work.size());
    const double begin = seconds_now();
    parallel_for(threads, 1, [&](std::int64_t index, std::int64_t) {
        const auto i = static_cast<std::size_t>(index);
        work[i] = HWY_DYNAMIC_DISPATCH(run_chains_of)(number, length, &results[i]);
    });
    return std::accumulate(work.begin(), work.end(), 0.0) / (seconds_now() - begin);
}

double best_rate_of(NumberFormat number) {
    constexpr int runs = 7;
    double best = 0.0;
    for (int run = 0; run < runs; ++run) best = std::max(best, rate_of(number));
    return best;
}

}  // namespace

MachinePeak measure_machine_peak() {
    return {best_rate_of(NumberFormat::float32), best_rate_of(NumberFormat::bfloat16)};
}

double measure_multiply_adds() {
    return rate_of(NumberFormat::float32);
}

}  // namespace stymo::kernels
#endif
