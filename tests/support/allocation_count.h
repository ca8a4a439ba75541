#pragma once

#include <cstdint>

namespace stymo::test {

/// How often this program has asked malloc for memory, on all threads; -1 where that cannot be
/// counted (sanitizers, other C libraries than glibc).
[[nodiscard]] std::int64_t allocation_count();

}  // namespace stymo::test
