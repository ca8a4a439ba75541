#pragma once

#include <filesystem>

namespace stymo {

/// A temporary folder next to the target. `finish` moves its files to the target; otherwise the
/// destructor removes it, so that an interruption leaves no partial results.
class FolderInProgress {
public:
    /// Creates the temporary folder and the parents of `target`. Throws FileError if that fails, or
    /// if `target` is a file.
    explicit FolderInProgress(const std::filesystem::path& target);
    ~FolderInProgress();
    FolderInProgress(const FolderInProgress&) = delete;
    FolderInProgress& operator=(const FolderInProgress&) = delete;

    /// The temporary folder.
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// Flushes the files to the disk and renames the folder to `target`. If `target` exists and has
    /// files of other names, the files move into it one by one and replace those of the same name.
    /// Throws FileError if renaming fails.
    void finish();

private:
    std::filesystem::path target_;
    std::filesystem::path path_;
};

}  // namespace stymo
