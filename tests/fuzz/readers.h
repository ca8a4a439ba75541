#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>

namespace stymo::fuzz {

/// What reads the bytes of a file in one way; throws an Error for bytes that are no such file.
using Reader = std::function<void(const std::string& bytes)>;

/// All readers by name.
[[nodiscard]] const std::map<std::string, Reader>& readers();

}  // namespace stymo::fuzz
