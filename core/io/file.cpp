#include "core/io/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <random>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "core/error.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// Removes a file at the end of the scope; after a successful rename there is nothing left to
/// remove.
class TemporaryFile {
public:
    explicit TemporaryFile(fs::path path) : path_(std::move(path)) {}
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;
    ~TemporaryFile() {
        std::error_code ignored;
        fs::remove(path_, ignored);
    }
    [[nodiscard]] const fs::path& path() const { return path_; }

private:
    fs::path path_;
};

fs::path temporary_beside(const fs::path& path) {
    // A name may have 255 bytes.
    constexpr std::size_t most_of_name = 100;
    return path.parent_path() / ("." + path.stem().string().substr(0, most_of_name) + "." +
                                 name_of_this_write() + ".part" + path.extension().string());
}

/// Whether `temporary_beside` made this name.
bool is_temporary(const fs::path& path) {
    const std::string name = path.filename().string();
    const std::size_t end = name.rfind(".part");
    const std::size_t number = end == std::string::npos ? end : name.rfind('.', end - 1);
    return name.starts_with('.') && number != std::string::npos && number > 0 && number + 1 < end &&
           name.find_first_not_of("0123456789-", number + 1) == end;
}

const char* reason_of(int error_number) {
    return std::strerror(error_number);
}

/// A file opened by the system, closed at the end of the scope.
class Descriptor {
public:
    Descriptor(const fs::path& path, int flags)
        : number_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
    Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
    Descriptor& operator=(Descriptor&&) = delete;
    ~Descriptor() {
        if (number_ >= 0) ::close(number_);
    }
    [[nodiscard]] bool is_open() const { return number_ >= 0; }
    [[nodiscard]] int number() const { return number_; }

private:
    int number_;
};

Descriptor open_for_reading(const fs::path& path) {
    std::error_code error;
    if (fs::is_directory(path, error))
        fail<FileError>(path.string(), ": cannot be read (is a folder)");
    Descriptor file(path, O_RDONLY);
    if (!file.is_open())
        fail<FileError>(path.string(), ": cannot be read (", reason_of(errno), ")");
    return file;
}

/// Number of bytes read; 0 at the end of the file, or if there is no room.
std::size_t read_some(const fs::path& path, const Descriptor& file, std::span<char> room) {
    ssize_t count = -1;
    do {
        count = ::read(file.number(), room.data(), room.size());
    } while (count < 0 && errno == EINTR);
    if (count < 0) fail<FileError>(path.string(), ": cannot be read (", reason_of(errno), ")");
    return static_cast<std::size_t>(count);
}

/// Returns false with errno set if the disk fails.
bool flushed(const Descriptor& file) {
    // EINVAL: the file system keeps nothing on a disk.
    return file.is_open() && (::fsync(file.number()) == 0 || errno == EINVAL);
}

void flush_one(const fs::path& path) {
    const Descriptor file(path, O_RDONLY);
    if (!flushed(file))
        fail<FileError>(path.string(), ": cannot be written to the disk (", reason_of(errno), ")");
}

fs::path folder_of(const fs::path& path) {
    return path.parent_path().empty() ? fs::path(".") : path.parent_path();
}

/// Returns false with errno set if the system takes fewer bytes.
bool written(const Descriptor& file, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(file.number(), bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return false;
        bytes.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
}

}  // namespace

void read_parts(const fs::path& path, const std::function<void(std::string_view)>& visit) {
    const Descriptor file = open_for_reading(path);
    std::vector<char> part(std::size_t{1} << 16U);
    while (const std::size_t count = read_some(path, file, part)) visit({part.data(), count});
}

std::string read_file(const fs::path& path) {
    const Descriptor file = open_for_reading(path);
    // One byte more than the file is said to have shows its end. Files of /proc are said to be
    // empty.
    std::error_code ignored;
    const std::uintmax_t size = fs::file_size(path, ignored);
    constexpr std::uintmax_t least = 4096;
    std::string text(ignored ? least : std::max(size + 1, least), '\0');
    std::size_t filled = 0;
    const bool may_be_endless = !fs::is_regular_file(path, ignored);
    constexpr std::size_t most_of_endless = std::size_t{1} << 30U;
    while (const std::size_t count = read_some(path, file, std::span(text).subspan(filled))) {
        filled += count;
        if (may_be_endless && filled > most_of_endless)
            fail<FileError>(path.string(), ": cannot be read (is no file, and has no end)");
        if (filled == text.size()) text.resize(2 * filled);
    }
    text.resize(filled);
    return text;
}

std::string read_beginning(const fs::path& path, std::size_t count) {
    const Descriptor file = open_for_reading(path);
    std::string text(count, '\0');
    std::size_t size = 0;
    while (const std::size_t more = read_some(path, file, std::span(text).subspan(size)))
        size += more;
    text.resize(size);
    return text;
}

struct OpenFile::Implementation {
    explicit Implementation(const fs::path& name) : path(name), file(open_for_reading(name)) {}

    fs::path path;
    Descriptor file;
};

OpenFile::OpenFile(const fs::path& path)
    : implementation_(std::make_shared<const Implementation>(path)) {}

std::string OpenFile::read(std::int64_t offset, std::int64_t size) const {
    std::string bytes(static_cast<std::size_t>(size), '\0');
    for (std::int64_t done = 0; done < size;) {
        const ssize_t count =
            ::pread(implementation_->file.number(), bytes.data() + done,
                    static_cast<std::size_t>(size - done), static_cast<off_t>(offset + done));
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0)
            fail<FileError>(implementation_->path.string(), ": cannot be read (",
                            count == 0 ? "it ends too early" : reason_of(errno), ")");
        done += count;
    }
    return bytes;
}

void prefetch(const fs::path& path) {
    const Descriptor file(path, O_RDONLY);
    if (file.is_open())
        static_cast<void>(::posix_fadvise(file.number(), 0, 0, POSIX_FADV_WILLNEED));
}

std::string name_of_this_write() {
    static const std::uint32_t process = std::random_device()();
    static std::atomic<std::uint64_t> writes{0};
    return std::to_string(::getpid()) + "-" + std::to_string(process) + "-" +
           std::to_string(writes++);
}

void write_whole(const fs::path& path, const std::function<void(const fs::path&)>& write,
                 Durability durability) {
    std::error_code error;
    if (fs::is_directory(path, error))
        fail<FileError>(path.string(), ": cannot be written (is a folder)");
    // Several encoders report a missing or read-only folder unclearly or not at all.
    const fs::path folder = folder_of(path);
    if (::access(folder.c_str(), W_OK | X_OK) != 0)
        fail<FileError>(path.string(), ": cannot be written (", reason_of(errno), ")");
    const TemporaryFile temporary(temporary_beside(path));
    write(temporary.path());
    // A name must not reach the disk before the bytes that it stands for.
    if (durability == Durability::crash_safe) flush_one(temporary.path());
    fs::rename(temporary.path(), path, error);
    if (error) fail<FileError>(path.string(), ": cannot be written (", error.message(), ")");
    if (durability == Durability::crash_safe) flush_names(folder);
}

void write_file(const fs::path& path, std::string_view text, Durability durability) {
    const auto write = [&](const fs::path& temporary) {
        const Descriptor file(temporary, O_WRONLY | O_CREAT | O_EXCL);
        if (!file.is_open() || !written(file, text))
            fail<FileError>(path.string(), ": cannot be written (", reason_of(errno), ")");
    };
    write_whole(path, write, durability);
}

void remove_temporary_files(const fs::path& folder) {
    std::error_code ignored;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
        if (is_temporary(entry.path())) fs::remove(entry.path(), ignored);
}

void append_line(const fs::path& path, std::string_view line, Durability durability) {
    const Descriptor file(path, O_WRONLY | O_CREAT | O_APPEND);
    const off_t end = file.is_open() ? ::lseek(file.number(), 0, SEEK_END) : -1;
    const bool flush = durability == Durability::crash_safe;
    if (end < 0 || !written(file, std::string(line) + '\n') || (flush && !flushed(file))) {
        const int reason = errno;
        if (end >= 0) static_cast<void>(::ftruncate(file.number(), end) == 0);
        fail<FileError>(path.string(), ": cannot be written (", reason_of(reason), ")");
    }
    if (flush) flush_names(folder_of(path));
}

void flush_to_disk(const fs::path& path) {
    if (fs::is_directory(path)) {
        for (const fs::directory_entry& entry : fs::directory_iterator(path))
            if (entry.is_regular_file() || entry.is_directory()) flush_to_disk(entry.path());
    }
    flush_one(path);
}

void flush_names(const fs::path& folder) {
    flush_one(folder);
}

void require_writable_folder(const fs::path& path) {
    std::error_code error;
    std::vector<fs::path> missing;
    for (fs::path at = (path / "").parent_path(); !at.empty() && !fs::exists(at, error);
         at = at.parent_path())
        missing.push_back(at);
    fs::create_directories(path, error);
    std::error_code unknown;
    if (!fs::is_directory(path, unknown))
        fail<FileError>(path.string(), ": the folder cannot be made (",
                        error ? error.message() : "a file has this name", ")");
    if (::access(path.c_str(), W_OK | X_OK) != 0)
        fail<FileError>(path.string(), ": the folder cannot be written to (", reason_of(errno),
                        ")");
    for (const fs::path& made : missing) flush_names(folder_of(made));
}

}  // namespace stymo
