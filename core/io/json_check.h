#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace stymo {

/// Deeper arrays and objects than any file of this project has; the functions that print and
/// compare parsed JSON call themselves once for each level.
inline constexpr int deepest_json = 32;

/// What a JSON parser would silently accept: nesting beyond `deepest_json`, or one key twice in the
/// same object, of which only the last would count. Nothing if there is neither; whether the text
/// is JSON at all is left to the parser.
[[nodiscard]] std::optional<std::string> json_fault(std::string_view text);
/// Throws FileError with the fault, if there is one.
void require_sound_json(std::string_view text);

}  // namespace stymo
