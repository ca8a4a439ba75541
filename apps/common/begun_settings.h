#pragma once

#include <filesystem>
#include <string>

namespace stymo {

/// For work in `folder` that goes on after an interruption: `begun` and `wanted` are the settings, JSON objects of texts, numbers
/// and truth values that one tool wrote, named as the command line does. Throws FileError that names the first that differs.
void require_same_settings(const std::filesystem::path& folder, const std::string& begun, const std::string& wanted);

}  // namespace stymo
