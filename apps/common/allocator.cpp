#include "apps/common/allocator.h"

// Any standard header tells whether this is the GNU library.
#include <cstdlib>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace stymo {

void tune_allocator() {
#ifdef __GLIBC__
    // By default a buffer above 32 MB is mapped when it is asked for and unmapped when it is freed, so that every op pays a
    // page fault and a cleared page for each 4 KiB of its result. Kept in the heap, the same pages go from op to op.
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, -1);  // never hand the top of the heap back
    mallopt(M_TOP_PAD, 64 << 20);
#endif
}

}  // namespace stymo
