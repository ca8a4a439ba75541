#include "core/io/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>

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
    const std::string name = "." + path.stem().string() + "." + std::to_string(::getpid()) +
                             ".part" + path.extension().string();
    return path.parent_path() / name;
}

const char* reason_of(int error_number) {
    return std::strerror(error_number);
}

std::ifstream open_for_reading(const fs::path& path) {
    std::error_code error;
    if (fs::is_directory(path, error)) {
        fail<FileError>(path.string(), ": cannot be read (is a folder)");
    }
    errno = 0;
    std::ifstream stream(path, std::ios::binary);
    if (!stream) {
        fail<FileError>(path.string(), ": cannot be read (", reason_of(errno), ")");
    }
    return stream;
}

}  // namespace

std::string read_text_file(const fs::path& path) {
    std::ifstream stream = open_for_reading(path);
    std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (stream.bad()) {
        fail<FileError>(path.string(), ": cannot be read (", reason_of(errno), ")");
    }
    return text;
}

std::string read_beginning(const fs::path& path, std::size_t count) {
    std::ifstream stream = open_for_reading(path);
    std::string text(count, '\0');
    stream.read(text.data(), static_cast<std::streamsize>(count));
    if (stream.bad()) {
        fail<FileError>(path.string(), ": cannot be read (", reason_of(errno), ")");
    }
    text.resize(static_cast<std::size_t>(stream.gcount()));
    return text;
}

void write_whole(const fs::path& path, const std::function<void(const fs::path&)>& write) {
    std::error_code error;
    if (fs::is_directory(path, error)) {
        fail<FileError>(path.string(), ": cannot be written (is a folder)");
    }
    // Several encoders report a missing or read-only folder unclearly or not at all.
    const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
    if (::access(folder.c_str(), W_OK | X_OK) != 0) {
        fail<FileError>(path.string(), ": cannot be written (", reason_of(errno), ")");
    }
    const TemporaryFile temporary(temporary_beside(path));
    write(temporary.path());
    fs::rename(temporary.path(), path, error);
    if (error) {
        fail<FileError>(path.string(), ": cannot be written (", error.message(), ")");
    }
}

void write_text_file(const fs::path& path, std::string_view text) {
    write_whole(path, [&](const fs::path& temporary) {
        errno = 0;
        std::ofstream stream(temporary, std::ios::binary);
        stream.write(text.data(), static_cast<std::streamsize>(text.size()));
        stream.close();
        if (!stream) {
            fail<FileError>(path.string(), ": cannot be written (", reason_of(errno), ")");
        }
    });
}

void flush_to_disk(const fs::path& path) {
    if (fs::is_directory(path)) {
        for (const fs::directory_entry& entry : fs::directory_iterator(path))
            if (entry.is_regular_file()) flush_to_disk(entry.path());
    }
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    const bool flushed = descriptor >= 0 && ::fsync(descriptor) == 0;
    const int error = errno;
    if (descriptor >= 0) ::close(descriptor);
    if (!flushed)
        fail<FileError>(path.string(), ": cannot be written to the disk (", reason_of(error), ")");
}

void require_writable_folder(const fs::path& path) {
    std::error_code error;
    fs::create_directories(path, error);
    if (!fs::is_directory(path)) {
        fail<FileError>(path.string(), ": the folder cannot be made (",
                        error ? error.message() : "a file has this name", ")");
    }
    if (::access(path.c_str(), W_OK | X_OK) != 0) {
        fail<FileError>(path.string(), ": the folder cannot be written to (", reason_of(errno),
                        ")");
    }
}

}  // namespace stymo
