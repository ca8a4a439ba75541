#include "core/config.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <variant>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {

namespace {

using Json = nlohmann::ordered_json;

/// Bounds as double for numbers and as int64 for whole numbers, because a double cannot represent
/// the largest int64 values.
struct Range {
    double low = 0.0;
    double high = 0.0;
    std::int64_t whole_low = 0;
    std::int64_t whole_high = 0;
};

using Target = std::variant<std::int64_t*, double*, bool*, std::string*, std::vector<std::int64_t>*,
                            std::vector<double>*>;

struct Entry {
    std::string key;
    Target target;
    Json default_value;
    Range range;
    std::vector<std::string> allowed;  ///< values of a choice; empty otherwise
    std::string help;
};

std::string range_text(const Range& range, bool whole) {
    // JSON writes a double with the fewest digits that read back to the same value.
    const auto text = [](auto low, auto high) {
        return "[" + Json(low).dump() + ", " + Json(high).dump() + "]";
    };
    return whole ? text(range.whole_low, range.whole_high) : text(range.low, range.high);
}

/// One line for messages, even if the value is not valid UTF-8.
std::string message_text(const Json& value) {
    return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string joined(const std::vector<std::string>& parts) {
    std::string result;
    for (const std::string& part : parts) result += (result.empty() ? "" : ", ") + part;
    return result;
}

std::string allowed_text(const Entry& entry) {
    struct Visitor {
        const Entry& entry;
        std::string operator()(std::int64_t*) const {
            return "an integer in " + range_text(entry.range, true);
        }
        std::string operator()(double*) const {
            return "a number in " + range_text(entry.range, false);
        }
        std::string operator()(bool*) const { return "true or false"; }
        std::string operator()(std::string*) const {
            return entry.allowed.empty() ? "a string" : "one of " + joined(entry.allowed);
        }
        std::string operator()(std::vector<std::int64_t>*) const {
            return "an array of integers in " + range_text(entry.range, true);
        }
        std::string operator()(std::vector<double>*) const {
            return "an array of numbers in " + range_text(entry.range, false);
        }
    };
    return std::visit(Visitor{entry}, entry.target);
}

std::optional<double> as_number(const Json& value, const Range& range) {
    if (!value.is_number()) return std::nullopt;
    const double number = value.get<double>();
    return number >= range.low && number <= range.high ? std::optional(number) : std::nullopt;
}

/// A whole number may be written as 200000 or as 2e5.
std::optional<std::int64_t> as_integer(const Json& value, const Range& range) {
    std::int64_t number = 0;
    if (value.is_number_integer()) {
        const bool too_large =
            value.is_number_unsigned() &&
            value.get<std::uint64_t>() > std::uint64_t{std::numeric_limits<std::int64_t>::max()};
        if (too_large) return std::nullopt;
        number = value.get<std::int64_t>();
    } else {
        // Beyond 2^53 a double no longer represents every whole number.
        const double written = value.is_number() ? value.get<double>() : 0.5;
        if (std::abs(written) > 0x1p53 || written != std::trunc(written)) return std::nullopt;
        number = static_cast<std::int64_t>(written);
    }
    return number >= range.whole_low && number <= range.whole_high ? std::optional(number)
                                                                   : std::nullopt;
}

/// Whether JSON can represent the value; a bare word may be invalid UTF-8.
bool is_writable(const Json& value) {
    try {
        static_cast<void>(value.dump());
        return true;
    } catch (const Json::type_error&) {
        return false;
    }
}

template <class T, class Convert>
bool assign_array(const Json& value, std::vector<T>& target, Convert convert) {
    if (!value.is_array()) return false;
    std::vector<T> items;
    for (const Json& item : value) {
        const std::optional<T> converted = convert(item);
        if (!converted) return false;
        items.push_back(*converted);
    }
    target = std::move(items);
    return true;
}

/// Sets the field if the value has its type and range; false otherwise.
bool assign(const Entry& entry, const Json& value) {
    struct Visitor {
        const Entry& entry;
        const Json& value;
        bool operator()(std::int64_t* target) const {
            const auto number = as_integer(value, entry.range);
            if (number) *target = *number;
            return number.has_value();
        }
        bool operator()(double* target) const {
            const auto number = as_number(value, entry.range);
            if (number) *target = *number;
            return number.has_value();
        }
        bool operator()(bool* target) const {
            if (value.is_boolean()) *target = value.get<bool>();
            return value.is_boolean();
        }
        bool operator()(std::string* target) const {
            if (!value.is_string()) return false;
            const auto text = value.get<std::string>();
            if (!entry.allowed.empty() &&
                std::ranges::find(entry.allowed, text) == entry.allowed.end())
                return false;
            *target = text;
            return true;
        }
        bool operator()(std::vector<std::int64_t>* target) const {
            return assign_array(value, *target,
                                [&](const Json& item) { return as_integer(item, entry.range); });
        }
        bool operator()(std::vector<double>* target) const {
            return assign_array(value, *target,
                                [&](const Json& item) { return as_number(item, entry.range); });
        }
    };
    return std::visit(Visitor{entry, value}, entry.target);
}

Json present_value(const Entry& entry) {
    return std::visit([](const auto* target) { return Json(*target); }, entry.target);
}

/// Number of single-character edits between two words.
std::size_t edit_distance(const std::string& a, const std::string& b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, changed});
        }
    }
    return row[b.size()];
}

std::string last_part(const std::string& key) {
    return key.substr(key.rfind('.') + 1);
}

Json parse_strictly(std::string_view text, const std::string& source) {
    if (const auto fault = json_fault(text)) fail<ConfigError>(source, ": ", *fault);
    try {
        return Json::parse(text);
    } catch (const Json::parse_error& error) {
        const std::string_view before = text.substr(0, error.byte == 0 ? 0 : error.byte - 1);
        fail<ConfigError>(source, ": not JSON at line ", 1 + std::ranges::count(before, '\n'));
    } catch (const Json::out_of_range&) {
        fail<ConfigError>(source, ": a number is too large");
    }
}

}  // namespace

struct ConfigSchema::Implementation {
    std::vector<Entry> entries;

    void bind(std::string key, Target target, Range range, std::vector<std::string> allowed,
              std::string help) {
        if (std::ranges::find(entries, key, &Entry::key) != entries.end())
            fail<ConfigError>("the key ", key, " is bound twice");
        Entry entry{std::move(key), target, {}, range, std::move(allowed), std::move(help)};
        entry.default_value = present_value(entry);
        entries.push_back(std::move(entry));
    }

    [[nodiscard]] bool is_section(const std::string& path) const {
        return std::ranges::any_of(
            entries, [&](const Entry& entry) { return entry.key.starts_with(path + "."); });
    }

    [[nodiscard]] bool is_text(const std::string& key) const {
        const auto entry = std::ranges::find(entries, key, &Entry::key);
        return entry != entries.end() && std::holds_alternative<std::string*>(entry->target);
    }

    [[noreturn]] void unknown(const std::string& source, const std::string& key) const {
        constexpr std::size_t longest = 100;  // nothing longer is a misspelt key
        if (key.size() > longest)
            fail<ConfigError>(source, ": ", key.substr(0, longest), "...: unknown key");
        // A key without its section, or in a wrong section, counts as near as a misspelt key.
        const auto distance = [&](const Entry& entry) {
            return std::min(edit_distance(entry.key, key),
                            edit_distance(last_part(entry.key), last_part(key)) + 1);
        };
        const Entry* nearest = nullptr;
        std::size_t least = std::numeric_limits<std::size_t>::max();
        for (const Entry& entry : entries) {
            const std::size_t edits = distance(entry);
            if (edits < least) {
                least = edits;
                nearest = &entry;
            }
        }
        fail<ConfigError>(source, ": ", key, ": unknown key",
                          nearest == nullptr ? "" : "; did you mean " + nearest->key + "?");
    }

    void set(const std::string& source, const std::string& key, const Json& value) const {
        const auto entry = std::ranges::find(entries, key, &Entry::key);
        if (entry == entries.end()) unknown(source, key);
        if (!assign(*entry, value))
            fail<ConfigError>(source, ": ", key, " = ", message_text(value), ": must be ",
                              allowed_text(*entry));
    }

    void read_object(const std::string& source, const std::string& path, const Json& object) const {
        for (const auto& [name, value] : object.items()) {
            if (name.starts_with("$") || (path.empty() && name == "parent")) continue;
            const std::string key = path.empty() ? name : path + "." + name;
            // A dotted name would be a second way to write a key, and could set it twice.
            if (name.find('.') != std::string::npos)
                fail<ConfigError>(source, ": ", key, ": must be written as nested objects");
            if (is_section(key)) {
                if (!value.is_object())
                    fail<ConfigError>(source, ": ", key, " = ", message_text(value),
                                      ": must be an object");
                read_object(source, key, value);
            } else {
                set(source, key, value);
            }
        }
    }

    void read_json(const std::string& source, const Json& json) const {
        if (!json.is_object()) fail<ConfigError>(source, ": must be a JSON object");
        read_object(source, "", json);
    }

    void read_with_parents(const std::filesystem::path& path,
                           std::vector<std::filesystem::path>& open) const {
        const std::filesystem::path canonical = std::filesystem::weakly_canonical(path);
        if (std::ranges::find(open, canonical) != open.end())
            fail<ConfigError>(path.string(), ": its parents lead back to itself");
        open.push_back(canonical);
        const Json json = parse_strictly(stymo::read_file(path), path.string());
        if (json.is_object() && json.contains("parent")) {
            if (!json.at("parent").is_string())
                fail<ConfigError>(path.string(), ": parent = ", message_text(json.at("parent")),
                                  ": must be a file name");
            read_with_parents(path.parent_path() / json.at("parent").get<std::string>(), open);
        }
        read_json(path.string(), json);
        open.pop_back();
    }
};

ConfigSchema::ConfigSchema() : implementation_(std::make_unique<Implementation>()) {}
ConfigSchema::~ConfigSchema() = default;
ConfigSchema::ConfigSchema(ConfigSchema&&) noexcept = default;
ConfigSchema& ConfigSchema::operator=(ConfigSchema&&) noexcept = default;

void ConfigSchema::integer(std::string key, std::int64_t& target, std::int64_t low,
                           std::int64_t high, std::string help) {
    implementation_->bind(std::move(key), &target, {0.0, 0.0, low, high}, {}, std::move(help));
}

void ConfigSchema::number(std::string key, double& target, double low, double high,
                          std::string help) {
    implementation_->bind(std::move(key), &target, {low, high, 0, 0}, {}, std::move(help));
}

void ConfigSchema::boolean(std::string key, bool& target, std::string help) {
    implementation_->bind(std::move(key), &target, {}, {}, std::move(help));
}

void ConfigSchema::text(std::string key, std::string& target, std::string help) {
    implementation_->bind(std::move(key), &target, {}, {}, std::move(help));
}

void ConfigSchema::choice(std::string key, std::string& target, std::vector<std::string> allowed,
                          std::string help) {
    implementation_->bind(std::move(key), &target, {}, std::move(allowed), std::move(help));
}

void ConfigSchema::integers(std::string key, std::vector<std::int64_t>& target, std::int64_t low,
                            std::int64_t high, std::string help) {
    implementation_->bind(std::move(key), &target, {0.0, 0.0, low, high}, {}, std::move(help));
}

void ConfigSchema::numbers(std::string key, std::vector<double>& target, double low, double high,
                           std::string help) {
    implementation_->bind(std::move(key), &target, {low, high, 0, 0}, {}, std::move(help));
}

void ConfigSchema::read_file(const std::filesystem::path& path) {
    std::vector<std::filesystem::path> open;
    implementation_->read_with_parents(path, open);
}

void ConfigSchema::read_text(std::string_view json, const std::string& source) {
    const Json root = parse_strictly(json, source);
    if (root.is_object() && root.contains("parent"))
        fail<ConfigError>(source, ": parent: only a file can have one");
    implementation_->read_json(source, root);
}

void ConfigSchema::set(std::string_view assignment) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string_view::npos || equals == 0)
        fail<ConfigError>("\"", assignment, "\": must be key=value");
    const std::string key(assignment.substr(0, equals));
    const std::string text(assignment.substr(equals + 1));
    if (const auto fault = json_fault(text)) fail<ConfigError>("command line: ", key, ": ", *fault);
    Json value = Json::parse(text, nullptr, false);
    // A value that is not JSON is a bare word. So is any unquoted value of a text key: a folder may
    // be called 2024.
    if (value.is_discarded() || (!value.is_string() && implementation_->is_text(key))) value = text;
    if (!is_writable(value))
        fail<ConfigError>("command line: ", key, " = ", message_text(value), ": must be UTF-8");
    implementation_->set("command line", key, value);
}

std::string ConfigSchema::to_json() const {
    Json root = Json::object();
    for (const Entry& entry : implementation_->entries) {
        Json* node = &root;
        std::istringstream parts(entry.key);
        for (std::string part; std::getline(parts, part, '.');) {
            // [] would do so, but leave the value without its object if memory runs out.
            if (node->is_null()) *node = Json::object();
            node = &(*node)[part];
        }
        *node = present_value(entry);
    }
    return root.dump(2) + "\n";
}

std::string ConfigSchema::to_markdown() const {
    std::string table = "| key | default | allowed | meaning |\n|---|---|---|---|\n";
    for (const Entry& entry : implementation_->entries)
        table += "| `" + entry.key + "` | `" + entry.default_value.dump() + "` | " +
                 allowed_text(entry) + " | " + entry.help + " |\n";
    return table;
}

}  // namespace stymo
