#pragma once

#include <filesystem>
#include <string>

namespace stymo::fuzz {

/// A folder in memory (/dev/shm) of this process, removed at its end.
[[nodiscard]] const std::filesystem::path& scratch_folder();
/// Replaces the bytes of a file of this name ("name" or "folder/name") in the folder and returns
/// its path.
[[nodiscard]] std::filesystem::path scratch_file(const std::string& name, const std::string& bytes);

}  // namespace stymo::fuzz
