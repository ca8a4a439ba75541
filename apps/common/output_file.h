#pragma once

#include <filesystem>
#include <initializer_list>

namespace stymo {

/// Throws UsageError unless the file's name ends in one of `extensions` (".png"). Tools call this
/// before they begin to work.
void require_extension(const std::filesystem::path& path,
                       std::initializer_list<const char*> extensions);
/// Creates the parent folder of `path`. Throws FileError if that fails, or if `path` is a folder.
void require_folder_of(const std::filesystem::path& path);

}  // namespace stymo
