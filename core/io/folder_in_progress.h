#pragma once

#include <filesystem>

namespace stymo {

/// A folder beside the one to be written. It takes that one's place once it is complete and goes away otherwise, so that who
/// breaks off leaves nothing half-written.
class FolderInProgress {
public:
    /// Makes the folder and the parents of `target`. Throws FileError if that fails, or if `target` is a file.
    explicit FolderInProgress(const std::filesystem::path& target);
    ~FolderInProgress();
    FolderInProgress(const FolderInProgress&) = delete;
    FolderInProgress& operator=(const FolderInProgress&) = delete;

    /// Where to write until then.
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// Renames the folder to `target`. If that exists, the files move into it one by one, over those of the same name.
    /// Throws FileError if a name cannot be changed.
    void finish();

private:
    std::filesystem::path target_;
    std::filesystem::path path_;
};

}  // namespace stymo
