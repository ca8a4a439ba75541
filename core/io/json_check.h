#pragma once

#include <exception>
#include <optional>
#include <string>
#include <string_view>

namespace stymo {

/// Largest nesting of arrays and objects that is accepted, more than any file of this project has.
/// The functions that print and compare parsed JSON are recursive.
inline constexpr int deepest_json = 32;

/// Describes a fault that a JSON parser silently accepts: nesting beyond `deepest_json`, or a key
/// that occurs twice in the same object. Nothing if there is none. It does not check whether the
/// text is valid JSON.
[[nodiscard]] std::optional<std::string> json_fault(std::string_view text);
/// Throws FileError with the fault, if there is one.
void require_sound_json(std::string_view text);

/// Returns the number of this key. Throws FileError if it is larger than float32 holds.
double require_float(double number, std::string_view key);  // NOLINT(modernize-use-nodiscard)

/// What nlohmann::json's exceptions say, without their number.
[[nodiscard]] std::string plain_message(const std::exception& error);

/// Whether JSON can hold the text as it is.
[[nodiscard]] bool is_utf8(std::string_view text);

}  // namespace stymo
