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

/// A JSON value that is only ever written, kept as its text: results of the tools, lines of `stats.jsonl`.
///
/// Numbers are written with the fewest digits that read back to the same value, infinities and NaN as null, strings with
/// everything escaped that JSON asks for (bytes that are not UTF-8 become U+FFFD). Configuration files are read elsewhere.
class JsonValue {
public:
    JsonValue() = default;  ///< null
    // NOLINTBEGIN(google-explicit-constructor): whatever has a JSON form is taken as it is.
    JsonValue(std::same_as<bool> auto value) : text_(value ? "true" : "false") {}
    JsonValue(std::integral auto value) requires(!std::same_as<decltype(value), bool>) : text_(std::to_string(value)) {}
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

    /// Members in the order given; the caller sees to it that no key comes twice.
    [[nodiscard]] static JsonValue object(std::initializer_list<std::pair<std::string_view, JsonValue>> members = {});
    /// Appends a member to an object (or to null, which becomes one); throws ValueError on any other value.
    JsonValue& add(std::string_view key, const JsonValue& value);

    /// One line, without a newline at its end.
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
