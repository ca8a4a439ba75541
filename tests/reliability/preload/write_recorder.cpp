// Records what a program does to the files in a folder, for LD_PRELOAD. STYMO_RECORD_FOLDER names
// the folder (absolute, without symbolic links), STYMO_RECORD_LOG the file that the operations are
// appended to, in the format that ../operation_log.h reads.
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

#include "reliability/preload/next_function.h"

namespace {

using Path = std::optional<std::string>;  ///< below the folder; nothing for other paths

/// Keeps errno as the recorded call left it.
class KeepErrno {
public:
    KeepErrno() = default;
    KeepErrno(const KeepErrno&) = delete;
    KeepErrno& operator=(const KeepErrno&) = delete;
    ~KeepErrno() { errno = number_; }

private:
    int number_ = errno;
};

const std::string& folder() {
    // Never destroyed, because destructors of other libraries still write.
    static const auto* const path = [] {
        const char* const name = std::getenv("STYMO_RECORD_FOLDER");
        return new std::string(name == nullptr ? "" : name);
    }();
    return *path;
}

ssize_t write_unrecorded(int descriptor, const void* bytes, std::size_t count) {
    STYMO_NEXT(write);
    return next(descriptor, bytes, count);
}

void note(const std::string& line, std::string_view bytes = {}) {
    static const int log = [] {
        STYMO_NEXT(open);
        const char* const name = std::getenv("STYMO_RECORD_LOG");
        return name == nullptr ? -1 : next(name, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0644);
    }();
    const std::string text = line + "\n" + std::string(bytes);
    if (log >= 0 && write_unrecorded(log, text.data(), text.size()) < 0) std::abort();
}

std::string link_target(const std::string& path) {
    char target[PATH_MAX];
    const ssize_t length = ::readlink(path.c_str(), target, sizeof target);
    return length < 0 ? std::string() : std::string(target, static_cast<std::size_t>(length));
}

/// `path` without "." and "..", which need not exist.
std::string plain(const std::string& path) {
    std::string result;
    for (std::size_t begin = 0; begin < path.size();) {
        const std::size_t end = std::min(path.find('/', begin), path.size());
        const std::string part = path.substr(begin, end - begin);
        if (part == "..") {
            result.erase(std::min(result.rfind('/'), result.size()));
        } else if (!part.empty() && part != ".") {
            result += "/" + part;
        }
        begin = end + 1;
    }
    return result;
}

Path within(int base, const char* path) {
    if (folder().empty() || path == nullptr) return std::nullopt;
    std::string whole = path;
    if (!whole.starts_with('/')) {
        const std::string link =
            base == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/" + std::to_string(base);
        whole = link_target(link) + "/" + whole;
    }
    whole = plain(whole);
    if (!whole.starts_with(folder() + "/")) return std::nullopt;
    return whole.substr(folder().size() + 1);
}

/// The number of an open file or folder below the folder, or of the folder itself.
std::optional<std::string> file_number(int descriptor) {
    if (folder().empty()) return std::nullopt;
    const std::string path = link_target("/proc/self/fd/" + std::to_string(descriptor));
    struct stat about {};
    if (path != folder() && !path.starts_with(folder() + "/")) return std::nullopt;
    if (::fstat(descriptor, &about) != 0) return std::nullopt;
    return std::to_string(about.st_ino);
}

bool exists(int base, const char* path) {
    return ::faccessat(base, path, F_OK, 0) == 0;
}

/// Calls `open()`, and notes whether a file has appeared or lost its contents.
template <class Open>
int recorded_open(int base, const char* path, int flags, Open open) {
    const Path place = within(base, path);
    const bool is_new = place && (flags & O_CREAT) != 0 && !exists(base, path);
    const int descriptor = open();
    const KeepErrno keep;
    if (!place || descriptor < 0) return descriptor;
    const std::string number = file_number(descriptor).value_or("0");
    if (is_new) {
        note("make " + number + " " + *place);
    } else if ((flags & O_TRUNC) != 0) {
        note("size " + number + " 0");
    }
    return descriptor;
}

void note_write(int descriptor, off_t offset, std::string_view bytes) {
    if (const auto number = file_number(descriptor))
        note("write " + *number + " " + std::to_string(offset) + " " + std::to_string(bytes.size()),
             bytes);
}

/// Where the next write goes.
off_t position(int descriptor) {
    if (folder().empty()) return 0;
    struct stat about {};
    if ((::fcntl(descriptor, F_GETFL) & O_APPEND) != 0 && ::fstat(descriptor, &about) == 0)
        return about.st_size;
    return ::lseek(descriptor, 0, SEEK_CUR);
}

void note_two(const char* what, const Path& from, const Path& to) {
    if (from && to) note(std::string(what) + " " + *from + " " + *to);
}

void note_removed(int result, const Path& place) {
    const KeepErrno keep;
    if (result == 0 && place) note("remove " + *place);
}

void note_folder(int result, const Path& place) {
    const KeepErrno keep;
    struct stat about {};
    if (result == 0 && place && ::stat((folder() + "/" + *place).c_str(), &about) == 0)
        note("folder " + std::to_string(about.st_ino) + " " + *place);
}

void note_flush(int result, int descriptor) {
    const KeepErrno keep;
    const auto number = file_number(descriptor);
    if (result == 0 && number) note("flush " + *number);
}

mode_t mode_of(int flags, va_list rest) {
    return (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
}

int open_flags(const char* mode) {
    const std::string_view text = mode;
    if (text.starts_with('w')) return O_CREAT | O_TRUNC;
    return text.starts_with('a') ? O_CREAT : 0;
}

/// Notes the opening of a stream; what it writes is noted when it is closed.
template <class Open>
FILE* recorded_stream(const char* path, const char* mode, Open open) {
    FILE* stream = nullptr;
    recorded_open(AT_FDCWD, path, open_flags(mode), [&] {
        stream = open();
        return stream == nullptr ? -1 : ::fileno(stream);
    });
    return stream;
}

/// Notes what a stream has written, since its writes pass by the functions below. Those of
/// std::ofstream do not, and its stream is empty.
void note_contents(FILE* stream) {
    const int descriptor = ::fileno(stream);
    const bool reads = (::fcntl(descriptor, F_GETFL) & O_ACCMODE) == O_RDONLY;
    if (folder().empty() || reads || ::fwide(stream, 0) >= 0) return;
    const auto number = file_number(descriptor);
    std::string bytes;
    FILE* const copy = std::fopen(("/proc/self/fd/" + std::to_string(descriptor)).c_str(), "rb");
    if (!number || copy == nullptr) return;
    for (int byte = std::fgetc(copy); byte != EOF; byte = std::fgetc(copy))
        bytes += static_cast<char>(byte);
    std::fclose(copy);
    note("write " + *number + " 0 " + std::to_string(bytes.size()), bytes);
}

}  // namespace

// The functions keep the C library's declarations, and its names are reserved.
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" {

#define RECORD_OPEN(name)                                                                     \
    int name(const char* path, int flags, ...) {                                              \
        STYMO_NEXT(name);                                                                     \
        va_list rest;                                                                         \
        va_start(rest, flags);                                                                \
        const mode_t mode = mode_of(flags, rest);                                             \
        va_end(rest);                                                                         \
        return recorded_open(AT_FDCWD, path, flags, [&] { return next(path, flags, mode); }); \
    }
RECORD_OPEN(open)
RECORD_OPEN(open64)

#define RECORD_OPENAT(name)                                                                     \
    int name(int base, const char* path, int flags, ...) {                                      \
        STYMO_NEXT(name);                                                                       \
        va_list rest;                                                                           \
        va_start(rest, flags);                                                                  \
        const mode_t mode = mode_of(flags, rest);                                               \
        va_end(rest);                                                                           \
        return recorded_open(base, path, flags, [&] { return next(base, path, flags, mode); }); \
    }
RECORD_OPENAT(openat)
RECORD_OPENAT(openat64)

int creat(const char* path, mode_t mode) {
    STYMO_NEXT(creat);
    return recorded_open(AT_FDCWD, path, O_CREAT | O_TRUNC, [&] { return next(path, mode); });
}

FILE* fopen(const char* path, const char* mode) {
    STYMO_NEXT(fopen);
    return recorded_stream(path, mode, [&] { return next(path, mode); });
}

FILE* fopen64(const char* path, const char* mode) {
    STYMO_NEXT(fopen64);
    return recorded_stream(path, mode, [&] { return next(path, mode); });
}

int fclose(FILE* stream) {
    STYMO_NEXT(fclose);
    std::fflush(stream);
    note_contents(stream);
    return next(stream);
}

ssize_t write(int descriptor, const void* bytes, size_t count) {
    const off_t offset = position(descriptor);
    const ssize_t written = write_unrecorded(descriptor, bytes, count);
    const KeepErrno keep;
    if (written > 0)
        note_write(descriptor, offset,
                   {static_cast<const char*>(bytes), static_cast<size_t>(written)});
    return written;
}

ssize_t writev(int descriptor, const iovec* parts, int count) {
    STYMO_NEXT(writev);
    const off_t offset = position(descriptor);
    const ssize_t written = next(descriptor, parts, count);
    const KeepErrno keep;
    std::string bytes;
    for (int i = 0; written > 0 && i < count; ++i)
        bytes.append(static_cast<const char*>(parts[i].iov_base), parts[i].iov_len);
    if (written > 0) note_write(descriptor, offset, bytes.substr(0, static_cast<size_t>(written)));
    return written;
}

#define RECORD_PWRITE(name, offset_type)                                                 \
    ssize_t name(int descriptor, const void* bytes, size_t count, offset_type offset) {  \
        STYMO_NEXT(name);                                                                \
        const ssize_t written = next(descriptor, bytes, count, offset);                  \
        const KeepErrno keep;                                                            \
        if (written > 0)                                                                 \
            note_write(descriptor, offset,                                               \
                       {static_cast<const char*>(bytes), static_cast<size_t>(written)}); \
        return written;                                                                  \
    }
RECORD_PWRITE(pwrite, off_t)
RECORD_PWRITE(pwrite64, off64_t)

#define RECORD_FTRUNCATE(name, size_type)                                                \
    int name(int descriptor, size_type size) noexcept {                                  \
        STYMO_NEXT(name);                                                                \
        const int result = next(descriptor, size);                                       \
        const KeepErrno keep;                                                            \
        const auto number = file_number(descriptor);                                     \
        if (result == 0 && number) note("size " + *number + " " + std::to_string(size)); \
        return result;                                                                   \
    }
RECORD_FTRUNCATE(ftruncate, off_t)
RECORD_FTRUNCATE(ftruncate64, off64_t)

#define RECORD_TRUNCATE(name, size_type)                                               \
    int name(const char* path, size_type size) noexcept {                              \
        STYMO_NEXT(name);                                                              \
        const int result = next(path, size);                                           \
        const KeepErrno keep;                                                          \
        struct stat about {};                                                          \
        if (result == 0 && within(AT_FDCWD, path) && ::stat(path, &about) == 0)        \
            note("size " + std::to_string(about.st_ino) + " " + std::to_string(size)); \
        return result;                                                                 \
    }
RECORD_TRUNCATE(truncate, off_t)
RECORD_TRUNCATE(truncate64, off64_t)

int fsync(int descriptor) {
    STYMO_NEXT(fsync);
    const int result = next(descriptor);
    note_flush(result, descriptor);
    return result;
}

int fdatasync(int descriptor) {
    STYMO_NEXT(fdatasync);
    const int result = next(descriptor);
    note_flush(result, descriptor);
    return result;
}

int rename(const char* from, const char* to) noexcept {
    STYMO_NEXT(rename);
    const int result = next(from, to);
    const KeepErrno keep;
    if (result == 0) note_two("rename", within(AT_FDCWD, from), within(AT_FDCWD, to));
    return result;
}

int renameat(int from_base, const char* from, int to_base, const char* to) noexcept {
    STYMO_NEXT(renameat);
    const int result = next(from_base, from, to_base, to);
    const KeepErrno keep;
    if (result == 0) note_two("rename", within(from_base, from), within(to_base, to));
    return result;
}

int link(const char* from, const char* to) noexcept {
    STYMO_NEXT(link);
    const int result = next(from, to);
    const KeepErrno keep;
    if (result == 0) note_two("link", within(AT_FDCWD, from), within(AT_FDCWD, to));
    return result;
}

int unlink(const char* path) noexcept {
    STYMO_NEXT(unlink);
    const int result = next(path);
    note_removed(result, within(AT_FDCWD, path));
    return result;
}

int unlinkat(int base, const char* path, int flags) noexcept {
    STYMO_NEXT(unlinkat);
    const int result = next(base, path, flags);
    note_removed(result, within(base, path));
    return result;
}

int remove(const char* path) noexcept {
    STYMO_NEXT(remove);
    const int result = next(path);
    note_removed(result, within(AT_FDCWD, path));
    return result;
}

int rmdir(const char* path) noexcept {
    STYMO_NEXT(rmdir);
    const int result = next(path);
    note_removed(result, within(AT_FDCWD, path));
    return result;
}

int mkdir(const char* path, mode_t mode) noexcept {
    STYMO_NEXT(mkdir);
    const int result = next(path, mode);
    note_folder(result, within(AT_FDCWD, path));
    return result;
}

int mkdirat(int base, const char* path, mode_t mode) noexcept {
    STYMO_NEXT(mkdirat);
    const int result = next(base, path, mode);
    note_folder(result, within(base, path));
    return result;
}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)
