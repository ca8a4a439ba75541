#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/json_writer.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace stymo {

/// Options that do not fit together or cannot be understood, found by a tool's body; ends the tool with exit code 2.
class UsageError : public Error {
public:
    using Error::Error;
};

/// Options that every tool has.
struct CommonOptions {
    int threads = 0;  ///< 0: one for each processor
    std::uint64_t seed = 0;
    bool json = false;  ///< the result goes to stdout as one JSON object
};

/// What a tool found out: `text` for people, `json` for programs. Printed once, at the end, and not if the tool failed.
struct AppResult {
    std::string text;
    JsonValue json = JsonValue::object();
    /// Why this is only a part of what was asked for ("interrupted after 3 of 8 faces"); empty: it is all of it. Said on stderr
    /// behind the result, and the tool ends with exit code 1.
    std::string incomplete{};
};

using AppBody = std::function<AppResult(const CommonOptions&)>;

/// Refinements of an option that was just declared; may be chained.
class OptionRules {
public:
    explicit OptionRules(CLI::Option* option) : option_(option) {}

    OptionRules& required();
    /// Numbers in [low, high]; nan is none.
    OptionRules& range(double low, double high);
    OptionRules& one_of(const std::vector<std::string>& allowed);
    /// Only together with / never together with the option called `name`, which must have been declared already.
    OptionRules& needs(const std::string& name);
    OptionRules& excludes(const std::string& name);

private:
    CLI::Option* option_;
};

/// The options of a tool or of one of its commands.
class Command {
public:
    explicit Command(CLI::App* app) : app_(app) {}

    /// "--name" or "-n,--name" for an option, "name" for a positional argument. The present value of `target` is the default.
    /// T: int, std::int64_t, std::uint64_t, double, std::string, std::filesystem::path, std::optional of one of these
    /// (empty unless given), std::vector<std::string> (the option may be repeated). A path that is given is never empty.
    template <class T>
    OptionRules option(const std::string& name, T& target, const std::string& help);
    OptionRules flag(const std::string& name, bool& target, const std::string& help);

private:
    CLI::App* app_;
};

/// Turns argc and argv of a tool into a call of its body, and what the body does into output and an exit code:
/// 0 done; 1 failed or incomplete, with one line "stymo-fit: what, which file or key, what to do" on stderr; 2 wrong usage,
/// likewise (the parser's errors and UsageError).
class CommandLine : public Command {
public:
    CommandLine(const std::string& program, const std::string& description);
    ~CommandLine();
    CommandLine(const CommandLine&) = delete;
    CommandLine& operator=(const CommandLine&) = delete;

    /// Adds a command ("mix" of `stymo-edit mix`); what it needs is declared on the result. Lives as long as this object.
    Command command(const std::string& name, const std::string& description, AppBody body);

    /// Parses, sets the number of threads and the allocator, and calls the body of the command that was given, or `body` if
    /// none was. An empty `body` makes a command obligatory.
    [[nodiscard]] int run(int argc, const char* const* argv, const AppBody& body = {});
    /// The same with other streams in place of stdout and stderr.
    [[nodiscard]] int run(int argc, const char* const* argv, const AppBody& body, std::ostream& out, std::ostream& err);

private:
    struct Implementation;

    explicit CommandLine(std::unique_ptr<Implementation> implementation);

    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
