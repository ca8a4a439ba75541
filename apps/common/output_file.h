#pragma once

#include <filesystem>
#include <initializer_list>

namespace stymo {

/// Throws UsageError unless the file's name ends in one of `extensions` (".png"). To be asked before the work, not after it.
void require_extension(const std::filesystem::path& path, std::initializer_list<const char*> extensions);
/// Makes the folder that `path` is to stand in; throws FileError if that fails, or if a folder has the file's name.
void require_folder_of(const std::filesystem::path& path);

}  // namespace stymo
