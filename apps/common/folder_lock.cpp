#include "apps/common/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace stymo {

FolderLock::FolderLock(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / ".lock";
    file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file_ < 0)
        fail<FileError>(path.string(), ": cannot be written (", std::strerror(errno), ")");
    if (::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    ::close(file_);
    fail<FileError>(folder.string(),
                    ": another process is working in this folder; wait for it to end or choose "
                    "another one");
}

FolderLock::~FolderLock() {
    ::close(file_);
}

}  // namespace stymo
