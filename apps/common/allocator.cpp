#include "apps/common/allocator.h"

// Any standard header defines __GLIBC__ if this is the GNU library.
#include <cstdlib>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace stymo {

void tune_allocator() {
#ifdef __GLIBC__
    // By default a buffer above 32 MB is mapped when it is allocated and unmapped when it is freed,
    // so that every op pays for a page fault and a cleared page per 4 KiB of its result. With these
    // settings the pages stay in the heap and are reused.
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, -1);  // never hand the top of the heap back
    mallopt(M_TOP_PAD, 64 << 20);
#endif
}

}  // namespace stymo
