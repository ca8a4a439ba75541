#include "fuzz/scratch_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdlib>
#include <map>

namespace stymo::fuzz {

namespace {

class Folder {
public:
    Folder() : path_("/dev/shm/stymo-fuzz-" + std::to_string(::getpid())) {
        std::filesystem::create_directories(path_);
    }
    ~Folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

/// A file that stays open, because opening and emptying it takes longer than many readers do.
struct OpenedFile {
    std::filesystem::path path;
    int number;

    explicit OpenedFile(const std::string& name) : path(scratch_folder() / name) {
        std::filesystem::create_directories(path.parent_path());
        number = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
        if (number < 0) std::abort();
    }
};

}  // namespace

const std::filesystem::path& scratch_folder() {
    static const Folder folder;
    return folder.path();
}

std::filesystem::path scratch_file(const std::string& name, const std::string& bytes) {
    static std::map<std::string, OpenedFile> files;
    const OpenedFile& file = files.try_emplace(name, name).first->second;
    const auto size = static_cast<ssize_t>(bytes.size());
    if (::pwrite(file.number, bytes.data(), bytes.size(), 0) != size ||
        ::ftruncate(file.number, size) != 0)
        std::abort();
    return file.path;
}

}  // namespace stymo::fuzz
