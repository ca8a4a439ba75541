// Fails one call of a program, for LD_PRELOAD. STYMO_FAIL_CALL names what fails (open, read, write,
// flush, rename, allocate; create: what a read-only file system refuses), STYMO_FAIL_AT which of
// those calls (from 1 on; 0: none), and STYMO_FAIL_ERROR the error number. Calls on files count if
// their absolute path, without symbolic links, begins with STYMO_FAIL_PATH; allocations count once
// the program has opened such a file, because the libraries that it is linked with allocate before
// its main function. With STYMO_FAIL_EVER the later calls fail, too. The number of calls is written
// to STYMO_FAIL_COUNT at the end.
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "reliability/preload/next_function.h"

// The C library's own allocator. dlsym, which would find it, allocates itself.
extern "C" {
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)
}

namespace {

// Nothing here allocates, because allocations are among what fails.

struct Wish {
    const char* call = std::getenv("STYMO_FAIL_CALL");
    const char* place = std::getenv("STYMO_FAIL_PATH");
    long at = number("STYMO_FAIL_AT");
    int error = static_cast<int>(number("STYMO_FAIL_ERROR"));
    bool ever = std::getenv("STYMO_FAIL_EVER") != nullptr;

    static long number(const char* name) {
        const char* const text = std::getenv(name);
        return text == nullptr ? 0 : std::strtol(text, nullptr, 10);
    }
    [[nodiscard]] bool counts(const char* other) const {
        return call != nullptr && std::strcmp(call, other) == 0;
    }
};

const Wish& wish() {
    static const Wish wish;
    return wish;
}

std::atomic<long>& count() {
    static std::atomic<long> calls = 0;
    return calls;
}

/// Counts a call; true, with errno, if it is the one to fail.
bool fails_now() {
    const long number = ++count();
    const bool fails =
        wish().at > 0 && (number == wish().at || (wish().ever && number > wish().at));
    if (fails) errno = wish().error;
    return fails;
}

bool counts_at(const char* path) {
    if (path == nullptr || wish().place == nullptr) return false;
    char whole[2 * PATH_MAX];
    if (path[0] != '/') {
        if (::getcwd(whole, PATH_MAX) == nullptr) return false;
        std::strncat(whole, "/", 2);
        std::strncat(whole, path, PATH_MAX - 2);
        path = whole;
    }
    return std::strncmp(path, wish().place, std::strlen(wish().place)) == 0;
}

bool counts_at(int descriptor) {
    char link[64];
    char path[PATH_MAX];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const int before = errno;
    const ssize_t length = ::readlink(link, path, sizeof path - 1);
    errno = before;
    if (length <= 0) return false;
    path[length] = '\0';
    // A relative "path" is a pipe or a socket.
    return path[0] == '/' && counts_at(path);
}

template <class Place>
bool fails(const char* call, Place place) {
    return wish().counts(call) && counts_at(place) && fails_now();
}

std::atomic<bool>& has_begun() {
    static std::atomic<bool> begun = false;
    return begun;
}

bool fails_to_open(const char* path, bool to_write) {
    if (!counts_at(path)) return false;
    has_begun() = true;
    return (wish().counts("open") || (to_write && wish().counts("create"))) && fails_now();
}

bool writes(int flags) {
    return (flags & O_ACCMODE) != O_RDONLY;
}

bool writes(const char* mode) {
    return std::strpbrk(mode, "wa+") != nullptr;
}

bool fails_to_allocate() {
    return has_begun() && wish().counts("allocate") && fails_now();
}

struct Report {
    ~Report() {
        const char* const name = std::getenv("STYMO_FAIL_COUNT");
        if (name == nullptr) return;
        char text[32];
        const int length = std::snprintf(text, sizeof text, "%ld\n", count().load());
        const int file = ::open(name, O_WRONLY | O_CREAT | O_TRUNC, 0644);
        static_cast<void>(::write(file, text, static_cast<std::size_t>(length)) == 0);
        ::close(file);
    }
} const report;

}  // namespace

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" {

#define FAIL_OPEN(name)                                                           \
    int name(const char* path, int flags, ...) {                                  \
        STYMO_NEXT(name);                                                         \
        va_list rest;                                                             \
        va_start(rest, flags);                                                    \
        const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;    \
        va_end(rest);                                                             \
        return fails_to_open(path, writes(flags)) ? -1 : next(path, flags, mode); \
    }
FAIL_OPEN(open)
FAIL_OPEN(open64)

FILE* fopen(const char* path, const char* mode) {
    STYMO_NEXT(fopen);
    return fails_to_open(path, writes(mode)) ? nullptr : next(path, mode);
}

FILE* fopen64(const char* path, const char* mode) {
    STYMO_NEXT(fopen64);
    return fails_to_open(path, writes(mode)) ? nullptr : next(path, mode);
}

ssize_t read(int descriptor, void* bytes, size_t size) {
    STYMO_NEXT(read);
    return fails("read", descriptor) ? -1 : next(descriptor, bytes, size);
}

ssize_t pread(int descriptor, void* bytes, size_t size, off_t offset) {
    STYMO_NEXT(pread);
    return fails("read", descriptor) ? -1 : next(descriptor, bytes, size, offset);
}

ssize_t pread64(int descriptor, void* bytes, size_t size, off64_t offset) {
    STYMO_NEXT(pread64);
    return fails("read", descriptor) ? -1 : next(descriptor, bytes, size, offset);
}

size_t fread(void* bytes, size_t size, size_t items, FILE* stream) {
    STYMO_NEXT(fread);
    return fails("read", ::fileno(stream)) ? 0 : next(bytes, size, items, stream);
}

ssize_t write(int descriptor, const void* bytes, size_t size) {
    STYMO_NEXT(write);
    return fails("write", descriptor) ? -1 : next(descriptor, bytes, size);
}

ssize_t writev(int descriptor, const iovec* parts, int items) {
    STYMO_NEXT(writev);
    return fails("write", descriptor) ? -1 : next(descriptor, parts, items);
}

size_t fwrite(const void* bytes, size_t size, size_t items, FILE* stream) {
    STYMO_NEXT(fwrite);
    return fails("write", ::fileno(stream)) ? 0 : next(bytes, size, items, stream);
}

int fsync(int descriptor) {
    STYMO_NEXT(fsync);
    return fails("flush", descriptor) ? -1 : next(descriptor);
}

int access(const char* path, int kind) noexcept {
    STYMO_NEXT(access);
    return (kind & W_OK) != 0 && fails("create", path) ? -1 : next(path, kind);
}

int mkdir(const char* path, mode_t mode) noexcept {
    STYMO_NEXT(mkdir);
    return fails("create", path) ? -1 : next(path, mode);
}

int rename(const char* from, const char* to) noexcept {
    STYMO_NEXT(rename);
    return fails("rename", from) ? -1 : next(from, to);
}

void* malloc(size_t size) {
    return fails_to_allocate() ? nullptr : __libc_malloc(size);
}

void* calloc(size_t items, size_t size) {
    return fails_to_allocate() ? nullptr : __libc_calloc(items, size);
}

void* realloc(void* former, size_t size) {
    return fails_to_allocate() ? nullptr : __libc_realloc(former, size);
}

void* aligned_alloc(size_t alignment, size_t size) {
    return fails_to_allocate() ? nullptr : __libc_memalign(alignment, size);
}

int posix_memalign(void** result, size_t alignment, size_t size) {
    if (fails_to_allocate()) return ENOMEM;
    *result = __libc_memalign(alignment, size);
    return *result == nullptr ? ENOMEM : 0;
}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)
