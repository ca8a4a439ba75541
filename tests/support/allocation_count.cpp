#include "support/allocation_count.h"

#include <atomic>
#include <cstdlib>

#if defined(__GLIBC__) && !defined(STYMO_TEST_SANITIZED)

namespace {

std::atomic<std::int64_t> count{0};

}  // namespace

// operator new and Tensor both end here.
extern "C" {
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): glibc's name
void* __libc_malloc(std::size_t size);

void* malloc(std::size_t size) {
    count.fetch_add(1, std::memory_order_relaxed);
    return __libc_malloc(size);
}
}

std::int64_t stymo::test::allocation_count() {
    return count.load();
}

#else

std::int64_t stymo::test::allocation_count() {
    return -1;
}

#endif
