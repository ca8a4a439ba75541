#include "core/io/json_writer.h"

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"

namespace stymo {
namespace {

template <class T>
std::string number_text(T value) {
    if (!std::isfinite(value)) return "null";
    std::array<char, 32> digits{};
    const auto result = std::to_chars(digits.data(), digits.data() + digits.size(), value);
    return {digits.data(), result.ptr};
}

std::string string_text(std::string_view value) {
    return nlohmann::json(std::string(value))
        .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void insert_before_end(std::string& text, const std::string& item) {
    const bool empty = text.size() == 2;
    text.insert(text.size() - 1, empty ? item : "," + item);
}

}  // namespace

JsonValue::JsonValue(double value) : text_(number_text(value)) {}
JsonValue::JsonValue(float value) : text_(number_text(value)) {}
JsonValue::JsonValue(std::string_view value) : text_(string_text(value)) {}

JsonValue JsonValue::object(std::initializer_list<std::pair<std::string_view, JsonValue>> members) {
    JsonValue result;
    result.text_ = "{}";
    for (const auto& [key, value] : members) result.add(key, value);
    return result;
}

JsonValue& JsonValue::add(std::string_view key, const JsonValue& value) {
    if (text_ == "null") text_ = "{}";
    if (text_.front() != '{')
        fail<ValueError>("cannot add \"", key, "\" to a JSON value that is not an object: ", text_);
    insert_before_end(text_, string_text(key) + ":" + value.text_);
    return *this;
}

void JsonValue::append_item(const JsonValue& value) {
    insert_before_end(text_, value.text_);
}

}  // namespace stymo
