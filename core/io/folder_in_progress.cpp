#include "core/io/folder_in_progress.h"

#include <fcntl.h>

#include <cstdio>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

void rename_or_fail(const fs::path& from, const fs::path& to) {
    std::error_code error;
    fs::rename(from, to, error);
    if (error) fail<FileError>(to.string(), ": cannot be written (", error.message(), ")");
}

/// Whether a folder has a file for each one of another folder.
bool replaces_all(const fs::path& folder, const fs::path& other) {
    for (const auto& entry : fs::recursive_directory_iterator(other))
        if (!entry.is_directory() && !fs::exists(folder / entry.path().lexically_relative(other)))
            return false;
    return true;
}

}  // namespace

FolderInProgress::FolderInProgress(const fs::path& target) : target_((target / "").parent_path()) {
    std::error_code ignored;
    if (fs::exists(target_, ignored)) require_writable_folder(target_);
    const fs::path parent = target_.parent_path().empty() ? fs::path(".") : target_.parent_path();
    require_writable_folder(parent);
    path_ = parent / ("." + target_.filename().string() + "." + name_of_this_write() + ".part");
    require_writable_folder(path_);
}

FolderInProgress::~FolderInProgress() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

void FolderInProgress::finish() {
    flush_to_disk(path_);
    const fs::path parent = path_.parent_path();
    if (!fs::exists(target_)) {
        rename_or_fail(path_, target_);
        return flush_names(parent);
    }
    // In one step, so that no moment has files of both. A link stays one, to the folder it names.
    if (!fs::is_symlink(target_) && replaces_all(path_, target_)) {
        fs::permissions(path_, fs::status(target_).permissions());
        if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, target_.c_str(), RENAME_EXCHANGE) == 0)
            return flush_names(parent);
    }
    std::vector<fs::path> files;
    std::set<fs::path> folders;
    for (const auto& entry : fs::recursive_directory_iterator(path_)) {
        const fs::path destination = target_ / entry.path().lexically_relative(path_);
        if (entry.is_directory()) {
            require_writable_folder(destination);
        } else {
            files.push_back(destination);
            folders.insert(destination.parent_path());
        }
    }
    for (const fs::path& file : files)
        rename_or_fail(path_ / file.lexically_relative(target_), file);
    for (const fs::path& folder : folders) flush_names(folder);
}

}  // namespace stymo
