// The program that this is linked into defines functions of the C library. They come before those
// of every library that the program loads, count the calls, let some fail, and pass the others on.
#include "reliability/calls/failing_calls.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>
#include <unwind.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <new>

#include "reliability/preload/next_function.h"

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
#ifdef STYMO_TEST_SANITIZED
// The sanitizer's allocator, under the names by which it lets a program pass calls on.
#define STYMO_ALLOCATOR(function) __interceptor_##function
#else
// The C library's own allocator. dlsym, which would find it, allocates itself.
#define STYMO_ALLOCATOR(function) __libc_##function
#endif
extern "C" {
void* STYMO_ALLOCATOR(malloc)(size_t);
void* STYMO_ALLOCATOR(calloc)(size_t, size_t);
void* STYMO_ALLOCATOR(realloc)(void*, size_t);
void* STYMO_ALLOCATOR(memalign)(size_t, size_t);
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

namespace stymo {
namespace {

// Nothing here allocates, because allocations are among what fails.

std::atomic<const WatchedCalls*> watched = nullptr;
std::atomic<CallVisitor*> current_visitor = nullptr;
std::atomic<long> number_of_calls = 0;

/// Calls that are made while a call is looked at do not count.
thread_local bool busy = false;

class Busy {
public:
    Busy() { busy = true; }
    ~Busy() { busy = false; }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;
};

struct PartOfStack {
    CallStack stack;
    int skipped = 0;
};

_Unwind_Reason_Code add_frame(_Unwind_Context* context, void* pointer) {
    auto& [stack, skipped] = *static_cast<PartOfStack*>(pointer);
    // current_call_stack, the visitor, fails_now, and the function in place of the C library's.
    if (skipped < 4) {
        ++skipped;
        return _URC_NO_REASON;
    }
    stack.frames[stack.count++] = reinterpret_cast<void*>(_Unwind_GetIP(context));  // NOLINT
    return stack.count < stack.frames.size() ? _URC_NO_REASON : _URC_END_OF_STACK;
}

/// Counts a call; true, with errno, if it is one to fail.
[[gnu::noinline]] bool fails_now(const WatchedCalls& calls) {
    if (!current_visitor.load()->fails(++number_of_calls)) return false;
    errno = calls.error;
    return true;
}

bool counts_at(const WatchedCalls& calls, const char* path) {
    if (path == nullptr) return false;
    char whole[2 * PATH_MAX];
    if (path[0] != '/') {
        if (::getcwd(whole, PATH_MAX) == nullptr) return false;
        std::strncat(whole, "/", 2);
        std::strncat(whole, path, PATH_MAX - 2);
        path = whole;
    }
    return std::strncmp(path, calls.place.c_str(), calls.place.size()) == 0;
}

bool counts_at(const WatchedCalls& calls, int descriptor) {
    if (descriptor <= STDERR_FILENO) return false;  // what the tool says
    char link[64];
    char path[PATH_MAX];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const int before = errno;
    const ssize_t length = ::readlink(link, path, sizeof path - 1);
    errno = before;
    if (length <= 0) return false;
    path[length] = '\0';
    // A relative "path" is a pipe or a socket.
    return path[0] == '/' && counts_at(calls, path);
}

const WatchedCalls* watched_calls(CallKind kind) {
    const WatchedCalls* const calls = watched;
    return calls != nullptr && calls->kind == kind && !busy ? calls : nullptr;
}

template <class Place>
[[gnu::always_inline]] inline bool fails(CallKind kind, Place place) {
    const WatchedCalls* const calls = watched_calls(kind);
    if (calls == nullptr) return false;
    const Busy guard;
    return counts_at(*calls, place) && fails_now(*calls);
}

[[gnu::always_inline]] inline bool fails_to_open(const char* path, bool to_write) {
    return fails(CallKind::open, path) || (to_write && fails(CallKind::create, path));
}

[[gnu::always_inline]] inline bool fails_to_allocate() {
    const WatchedCalls* const calls = watched_calls(CallKind::allocate);
    if (calls == nullptr) return false;
    const Busy guard;
    return fails_now(*calls);
}

bool writes(int flags) {
    return (flags & O_ACCMODE) != O_RDONLY;
}

bool writes(const char* mode) {
    return std::strpbrk(mode, "wa+") != nullptr;
}

}  // namespace

std::uint64_t CallStack::hash() const {
    std::uint64_t hash = 14695981039346656037U;
    for (std::size_t i = 0; i < count; ++i) {
        hash = (hash ^ reinterpret_cast<std::uintptr_t>(frames[i])) * 1099511628211U;
        hash ^= hash >> 29U;
    }
    return hash == 0 ? 1 : hash;
}

CallStack current_call_stack() {
    PartOfStack part;
    _Unwind_Backtrace(add_frame, &part);
    return part.stack;
}

void watch_calls(const WatchedCalls& calls, CallVisitor& visitor) {
    number_of_calls = 0;
    current_visitor = &visitor;
    static_cast<void>(current_call_stack());  // whatever its first use sets up
    watched = &calls;
}

void stop_watching_calls() {
    watched = nullptr;
}

}  // namespace stymo

using stymo::CallKind;

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" {

#define FAIL_OPEN(name)                                                                         \
    int name(const char* path, int flags, ...) {                                                \
        STYMO_NEXT(name);                                                                       \
        va_list rest;                                                                           \
        va_start(rest, flags);                                                                  \
        const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;                  \
        va_end(rest);                                                                           \
        return stymo::fails_to_open(path, stymo::writes(flags)) ? -1 : next(path, flags, mode); \
    }
FAIL_OPEN(open)
FAIL_OPEN(open64)

FILE* fopen(const char* path, const char* mode) {
    STYMO_NEXT(fopen);
    return stymo::fails_to_open(path, stymo::writes(mode)) ? nullptr : next(path, mode);
}

FILE* fopen64(const char* path, const char* mode) {
    STYMO_NEXT(fopen64);
    return stymo::fails_to_open(path, stymo::writes(mode)) ? nullptr : next(path, mode);
}

ssize_t read(int descriptor, void* bytes, size_t size) {
    STYMO_NEXT(read);
    return stymo::fails(CallKind::read, descriptor) ? -1 : next(descriptor, bytes, size);
}

ssize_t pread(int descriptor, void* bytes, size_t size, off_t offset) {
    STYMO_NEXT(pread);
    return stymo::fails(CallKind::read, descriptor) ? -1 : next(descriptor, bytes, size, offset);
}

ssize_t pread64(int descriptor, void* bytes, size_t size, off64_t offset) {
    STYMO_NEXT(pread64);
    return stymo::fails(CallKind::read, descriptor) ? -1 : next(descriptor, bytes, size, offset);
}

size_t fread(void* bytes, size_t size, size_t items, FILE* stream) {
    STYMO_NEXT(fread);
    return stymo::fails(CallKind::read, ::fileno(stream)) ? 0 : next(bytes, size, items, stream);
}

ssize_t write(int descriptor, const void* bytes, size_t size) {
    STYMO_NEXT(write);
    return stymo::fails(CallKind::write, descriptor) ? -1 : next(descriptor, bytes, size);
}

ssize_t writev(int descriptor, const iovec* parts, int items) {
    STYMO_NEXT(writev);
    return stymo::fails(CallKind::write, descriptor) ? -1 : next(descriptor, parts, items);
}

size_t fwrite(const void* bytes, size_t size, size_t items, FILE* stream) {
    STYMO_NEXT(fwrite);
    return stymo::fails(CallKind::write, ::fileno(stream)) ? 0 : next(bytes, size, items, stream);
}

DIR* opendir(const char* path) {
    STYMO_NEXT(opendir);
    return stymo::fails_to_open(path, false) ? nullptr : next(path);
}

int fsync(int descriptor) {
    STYMO_NEXT(fsync);
    return stymo::fails(CallKind::flush, descriptor) ? -1 : next(descriptor);
}

int access(const char* path, int kind) noexcept {
    STYMO_NEXT(access);
    return (kind & W_OK) != 0 && stymo::fails(CallKind::create, path) ? -1 : next(path, kind);
}

int mkdir(const char* path, mode_t mode) noexcept {
    STYMO_NEXT(mkdir);
    return stymo::fails(CallKind::create, path) ? -1 : next(path, mode);
}

int rename(const char* from, const char* to) noexcept {
    STYMO_NEXT(rename);
    return stymo::fails(CallKind::rename, from) ? -1 : next(from, to);
}

void* malloc(size_t size) {
    return stymo::fails_to_allocate() ? nullptr : STYMO_ALLOCATOR(malloc)(size);
}

void* calloc(size_t items, size_t size) {
    return stymo::fails_to_allocate() ? nullptr : STYMO_ALLOCATOR(calloc)(items, size);
}

void* realloc(void* former, size_t size) {
    return stymo::fails_to_allocate() ? nullptr : STYMO_ALLOCATOR(realloc)(former, size);
}

void* aligned_alloc(size_t alignment, size_t size) {
    return stymo::fails_to_allocate() ? nullptr : STYMO_ALLOCATOR(memalign)(alignment, size);
}

int posix_memalign(void** result, size_t alignment, size_t size) {
    if (stymo::fails_to_allocate()) return ENOMEM;
    *result = STYMO_ALLOCATOR(memalign)(alignment, size);
    return *result == nullptr ? ENOMEM : 0;
}

void* memalign(size_t alignment, size_t size) {
    return stymo::fails_to_allocate() ? nullptr : STYMO_ALLOCATOR(memalign)(alignment, size);
}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

#ifdef STYMO_TEST_SANITIZED
// The sanitizer knows which memory is the dynamic loader's by who called malloc, which is this
// file. OpenImageIO loses the text of its own message when it cannot open a PNG.
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): the sanitizer's name
extern "C" const char* __lsan_default_suppressions() {
    return "leak:add_to_global_resize\nleak:OpenImageIO*geterror\n";
}
// What a tool prints is compared with what it should.
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): the sanitizer's name
extern "C" const char* __lsan_default_options() {
    return "print_suppressions=0";
}

// The sanitizer's operators would not call the functions above.
void* operator new(std::size_t size) {
    void* const memory = ::malloc(size);
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
}

void* operator new(std::size_t size, std::align_val_t alignment) {
    void* const memory = ::memalign(static_cast<std::size_t>(alignment), size);
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
}

void* operator new(std::size_t size, const std::nothrow_t& /*unused*/) noexcept {
    return ::malloc(size);
}

void operator delete(void* memory) noexcept {
    ::free(memory);
}

void operator delete(void* memory, std::size_t /*unused*/) noexcept {
    ::free(memory);
}

void operator delete(void* memory, std::align_val_t /*unused*/) noexcept {
    ::free(memory);
}

void operator delete(void* memory, std::size_t /*unused*/, std::align_val_t /*unused*/) noexcept {
    ::free(memory);
}
#endif
