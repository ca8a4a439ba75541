#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace stymo {

/// Binds the keys of a JSON configuration ("optimizer.learning_rate") to the fields of a plain
/// struct. The same binding reads files with parents, applies overrides from the command line,
/// writes the complete configuration and makes the table in the docs. An unknown key, a wrong type
/// or a value out of range throws ConfigError with the file, the key, the value, the allowed values
/// and the nearest known key.
class ConfigSchema {
public:
    ConfigSchema();
    ~ConfigSchema();
    ConfigSchema(ConfigSchema&&) noexcept;
    ConfigSchema& operator=(ConfigSchema&&) noexcept;

    /// Each function binds `target`, whose current value is the default. `help` is one line that
    /// names the paper's value if the paper has one.
    void integer(std::string key, std::int64_t& target, std::int64_t low, std::int64_t high,
                 std::string help);
    void number(std::string key, double& target, double low, double high, std::string help);
    void boolean(std::string key, bool& target, std::string help);
    void text(std::string key, std::string& target, std::string help);
    void choice(std::string key, std::string& target, std::vector<std::string> allowed,
                std::string help);
    void integers(std::string key, std::vector<std::int64_t>& target, std::int64_t low,
                  std::int64_t high, std::string help);
    void numbers(std::string key, std::vector<double>& target, double low, double high,
                 std::string help);

    /// Reads a JSON file of nested objects into the bound fields. "parent": a file relative to this
    /// one, read first; circular parents are an error. Keys beginning with "$" are comments.
    void read_file(const std::filesystem::path& path);
    /// The same for JSON text. Error messages name `source` as the file.
    void read_text(std::string_view json, const std::string& source);
    /// Applies an assignment "a.b=value". The value is JSON, or a bare word for text and choices.
    void set(std::string_view assignment);

    /// Every key with its current value, as nested, indented JSON.
    [[nodiscard]] std::string to_json() const;
    /// A Markdown table: key, default, allowed, meaning.
    [[nodiscard]] std::string to_markdown() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
