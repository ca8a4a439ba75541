#include "fuzz/scratch_file.h"

#include <unistd.h>

#include <fstream>

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

}  // namespace

const std::filesystem::path& scratch_folder() {
    static const Folder folder;
    return folder.path();
}

std::filesystem::path scratch_file(const std::string& name, const std::string& bytes) {
    std::filesystem::path path = scratch_folder() / name;
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
}

}  // namespace stymo::fuzz
