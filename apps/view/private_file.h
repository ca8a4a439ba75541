#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace stymo::view {

/// Calls `write` with the name of a temporary file that no other user can read, returns the file's
/// bytes and removes it.
[[nodiscard]] std::string written_bytes(
    const std::string& extension, const std::function<void(const std::filesystem::path&)>& write);

/// Calls `read` with such a file that holds `bytes`. Errors whose message begins with the name of
/// the file, which the user does not know, become FileErrors whose message begins with `called`
/// ("the photo").
void read_bytes(const std::string& bytes, const std::string& called,
                const std::function<void(const std::filesystem::path&)>& read);

}  // namespace stymo::view
