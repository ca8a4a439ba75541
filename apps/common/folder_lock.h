#pragma once

#include <filesystem>

namespace stymo {

/// Reserves a folder for this process. The lock ends with the process, however that ends.
class FolderLock {
public:
    /// Locks the file `folder`/.lock, which is never removed. Throws FileError if another process
    /// has locked the folder or the file cannot be made. Does nothing on a file system without
    /// locks.
    explicit FolderLock(const std::filesystem::path& folder);
    ~FolderLock();
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;

private:
    int file_;
};

}  // namespace stymo
