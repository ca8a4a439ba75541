#pragma once

#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace stymo {

/// Throws FileError unless `object` is one and has no other keys.
void require_keys(const nlohmann::json& object, const char* what,
                  std::initializer_list<std::string_view> known);
/// Throws FileError for a number that float32 cannot hold.
[[nodiscard]] double finite_number(const nlohmann::json& value, const char* what);
/// The message without its beginning, such as "[json.exception.parse_error.101] ".
[[nodiscard]] std::string plain_message(const nlohmann::json::exception& error);

}  // namespace stymo
