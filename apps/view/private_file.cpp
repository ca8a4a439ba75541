#include "apps/view/private_file.h"

#include <cstdlib>
#include <system_error>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo::view {

namespace {

/// A folder of this process alone, removed at the end.
class PrivateFolder {
public:
    PrivateFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "stymo-XXXXXX").string();
        if (mkdtemp(name.data()) == nullptr)
            fail<FileError>(name, ": cannot be made; set TMPDIR to a folder with room");
        path_ = name;
    }
    ~PrivateFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    PrivateFolder(const PrivateFolder&) = delete;
    PrivateFolder& operator=(const PrivateFolder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

}  // namespace

std::string written_bytes(const std::string& extension,
                          const std::function<void(const std::filesystem::path&)>& write) {
    const PrivateFolder folder;
    const std::filesystem::path file = folder.path() / ("file" + extension);
    write(file);
    return read_file(file);
}

void read_bytes(const std::string& bytes, const std::string& called,
                const std::function<void(const std::filesystem::path&)>& read) {
    const PrivateFolder folder;
    const std::filesystem::path file = folder.path() / "file";
    write_file(file, bytes, Durability::none);
    try {
        read(file);
    } catch (const FileError& error) {
        const std::string name = file.string();
        std::string text = error.what();
        if (text.starts_with(name)) text = called + text.substr(name.size());
        fail<FileError>(text);
    }
}

}  // namespace stymo::view
