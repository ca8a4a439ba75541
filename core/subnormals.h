#pragma once

#include <cfenv>

namespace stymo {

/// Flushes subnormal results (magnitudes below 2^-126 in float32 and 2^-1022 in float64) to zero,
/// on the calling thread and on threads that it starts later. Processors compute far more slowly
/// with subnormal numbers, which are frequent in fits (docs/decisions.md). Does nothing on
/// processors that are neither x86 nor ARM.
void flush_subnormals();

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
