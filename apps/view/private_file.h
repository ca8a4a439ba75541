#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace stymo::view {

/// Calls `write` with the name of a file that no one else can read, and returns its bytes. The file
/// is removed again.
[[nodiscard]] std::string written_bytes(
    const std::string& extension, const std::function<void(const std::filesystem::path&)>& write);

/// Calls `read` with such a file of these bytes. Errors that begin with the name of the file, which
/// the user does not know, begin with `called` instead ("the photo") and are FileErrors.
void read_bytes(const std::string& bytes, const std::string& called,
                const std::function<void(const std::filesystem::path&)>& read);

}  // namespace stymo::view
