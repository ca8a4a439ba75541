// A slow disk, for LD_PRELOAD: opening a stream of a file whose path contains STYMO_SLOW_PATH
// takes STYMO_SLOW_MILLISECONDS. The number of such files that were announced to the system before
// they were read is written to STYMO_SLOW_COUNT at the end.
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "reliability/preload/next_function.h"

namespace {

std::atomic<long>& announced() {
    static std::atomic<long> count = 0;
    return count;
}

bool is_slow(const char* path) {
    const char* const place = std::getenv("STYMO_SLOW_PATH");
    return path != nullptr && place != nullptr && std::strstr(path, place) != nullptr;
}

void wait_for(const char* path) {
    if (!is_slow(path)) return;
    const char* const time = std::getenv("STYMO_SLOW_MILLISECONDS");
    ::usleep(time == nullptr ? 0 : 1000 * static_cast<useconds_t>(std::atol(time)));
}

struct Report {
    ~Report() {
        const char* const name = std::getenv("STYMO_SLOW_COUNT");
        std::FILE* const file = name == nullptr ? nullptr : std::fopen(name, "w");
        if (file == nullptr) return;
        std::fprintf(file, "%ld\n", announced().load());
        std::fclose(file);
    }
} const report;

}  // namespace

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" {

FILE* fopen(const char* path, const char* mode) {
    STYMO_NEXT(fopen);
    wait_for(path);
    return next(path, mode);
}

FILE* fopen64(const char* path, const char* mode) {
    STYMO_NEXT(fopen64);
    wait_for(path);
    return next(path, mode);
}

int posix_fadvise(int descriptor, off_t offset, off_t length, int advice) {
    STYMO_NEXT(posix_fadvise);
    char link[64], path[PATH_MAX];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const ssize_t size = ::readlink(link, path, sizeof path - 1);
    path[size > 0 ? size : 0] = '\0';
    if (is_slow(path) && advice == POSIX_FADV_WILLNEED) ++announced();
    return next(descriptor, offset, length, advice);
}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)
