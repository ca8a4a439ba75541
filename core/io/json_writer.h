#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stymo {

/// A JSON value for output, stored as text, for example results of the tools and lines of
/// `stats.jsonl`.
///
/// Numbers are written with the fewest digits that read back to the same value, infinities and NaN
/// as null, strings with the escapes that JSON requires (bytes that are not UTF-8 become U+FFFD).
/// core/config.h reads configuration files.
class JsonValue {
public:
    JsonValue() = default;  ///< null
    // NOLINTBEGIN(google-explicit-constructor): implicit conversion from every type with a JSON
    // form.
    JsonValue(std::same_as<bool> auto value) : text_(value ? "true" : "false") {}
    JsonValue(std::integral auto value) requires(!std::same_as<decltype(value), bool>)
        : text_(std::to_string(value)) {}
    JsonValue(double value);
    JsonValue(float value);
    JsonValue(std::string_view value);
    JsonValue(const std::string& value) : JsonValue(std::string_view(value)) {}
    JsonValue(const char* value) : JsonValue(std::string_view(value)) {}
    template <class T>
    JsonValue(const std::vector<T>& values) : JsonValue(std::span<const T>(values)) {}
    template <class T>
    JsonValue(std::span<const T> values);
    // NOLINTEND(google-explicit-constructor)

    /// Members in the given order; keys must be distinct.
    [[nodiscard]] static JsonValue object(
        std::initializer_list<std::pair<std::string_view, JsonValue>> members = {});
    /// Appends a member to an object (or to null, which becomes one); throws ValueError on any
    /// other value.
    JsonValue& add(std::string_view key, const JsonValue& value);

    /// One line, without a final newline.
    [[nodiscard]] const std::string& text() const { return text_; }

private:
    void append_item(const JsonValue& value);

    std::string text_ = "null";
};

template <class T>
JsonValue::JsonValue(std::span<const T> values) : text_("[]") {
    for (const auto& value : values) append_item(JsonValue(static_cast<const T&>(value)));
}

}  // namespace stymo
