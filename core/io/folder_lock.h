#pragma once

#include <filesystem>

namespace stymo {

/// Keeps a folder for this process. A process that ends in any way gives it back.
class FolderLock {
public:
    /// Locks `folder`/.lock, which stays there afterwards. Throws FileError if another process has
    /// locked the folder or the file cannot be made. On a file system without locks it does
    /// nothing.
    explicit FolderLock(const std::filesystem::path& folder);
    ~FolderLock();
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;

private:
    int file_;
};

}  // namespace stymo
