#pragma once

#include <cfenv>
#include <cstdint>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace stymo {

/// Flushes subnormal results (magnitudes below 2^-126 in float32 and 2^-1022 in float64) to zero,
/// on the calling thread and on threads that it starts later. Processors compute far more slowly
/// with subnormal numbers, which are frequent in fits (docs/decisions.md). Operands are not
/// flushed: the conversion of 16-bit numbers uses subnormal ones. Does nothing on processors that
/// are neither x86 nor ARM.
inline void flush_subnormals() {
#if defined(__SSE__)
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
#elif defined(__aarch64__)
    constexpr std::uint64_t flush_to_zero = std::uint64_t{1} << 24;
    std::uint64_t control = 0;
    __asm__ volatile("mrs %0, fpcr" : "=r"(control));
    __asm__ volatile("msr fpcr, %0" : : "r"(control | flush_to_zero));
#endif
}

/// Does the same during its lifetime, on a thread that belongs to another program.
class SubnormalsFlushed {
public:
    SubnormalsFlushed() {
        std::fegetenv(&before_);
        flush_subnormals();
    }
    ~SubnormalsFlushed() { std::fesetenv(&before_); }
    SubnormalsFlushed(const SubnormalsFlushed&) = delete;
    SubnormalsFlushed& operator=(const SubnormalsFlushed&) = delete;

private:
    std::fenv_t before_{};
};

}  // namespace stymo
