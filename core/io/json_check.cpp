#include "core/io/json_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "core/error.h"

namespace stymo {
namespace {

/// Length of the string that begins with the quotation mark at the front, with both marks; to the
/// end of the text if it has no end.
std::size_t string_length(std::string_view text) {
    for (std::size_t i = 1; i < text.size(); ++i) {
        if (text[i] == '\\') {
            ++i;
        } else if (text[i] == '"') {
            return i + 1;
        }
    }
    return text.size();
}

/// The key without its marks; two spellings of one key give the same result.
std::string key_of(std::string_view quoted) {
    if (quoted.find('\\') != std::string_view::npos) {
        const nlohmann::json key = nlohmann::json::parse(quoted, nullptr, false);
        if (key.is_string()) return key.get<std::string>();
    }
    return std::string(quoted.substr(1, quoted.size() - std::min<std::size_t>(quoted.size(), 2)));
}

bool is_key(std::string_view rest) {
    const std::size_t next = rest.find_first_not_of(" \t\r\n");
    return next != std::string_view::npos && rest[next] == ':';
}

}  // namespace

std::optional<std::string> json_fault(std::string_view text) {
    // The parser takes a zero byte for the end.
    if (text.find('\0') != std::string_view::npos) return "holds a zero byte";
    std::vector<std::set<std::string>> open;  // the keys so far of each open object or array
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char letter = text[i];
        if (letter == '{' || letter == '[') {
            if (open.size() == deepest_json)
                return "nested deeper than " + std::to_string(deepest_json) + " levels";
            open.emplace_back();
        } else if ((letter == '}' || letter == ']') && !open.empty()) {
            open.pop_back();
        } else if (letter == '"') {
            const std::string_view quoted = text.substr(i, string_length(text.substr(i)));
            i += quoted.size() - 1;
            if (open.empty() || !is_key(text.substr(i + 1))) continue;
            const auto [key, is_new] = open.back().insert(key_of(quoted));
            if (!is_new) return "the key \"" + *key + "\" is given twice in one object";
        }
    }
    return std::nullopt;
}

double require_float(double number, std::string_view key) {
    if (!(std::abs(number) <= static_cast<double>(std::numeric_limits<float>::max())))
        fail<FileError>('"', key, "\" holds ", number, ", which is too large");
    return number;
}

std::string plain_message(const std::exception& error) {
    const std::string message = error.what();
    const std::size_t end = message.find("] ");
    return end == std::string::npos ? message : message.substr(end + 2);
}

bool is_utf8(std::string_view text) {
    try {
        static_cast<void>(nlohmann::json(text).dump());
        return true;
    } catch (const nlohmann::json::type_error&) {
        return false;
    }
}

void require_sound_json(std::string_view text) {
    if (const std::optional<std::string> fault = json_fault(text)) fail<FileError>(*fault);
}

}  // namespace stymo
