#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/io/json_writer.h"
#include "core/matmul_precision.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace stymo {

/// Wrong usage that a tool's body detects, such as options that exclude each other. The tool ends
/// with exit code 2.
class UsageError : public Error {
public:
    using Error::Error;
};

/// Options that every tool has.
struct CommonOptions {
    int threads = 0;               ///< 0: one per processor
    std::string matmul_precision;  ///< "highest", "high" or "medium"
    std::uint64_t seed = 0;
    bool json = false;     ///< the result goes to stdout as one JSON object
    bool explain = false;  ///< the work is reported, see apps/common/explain.h
};

/// A message without line breaks and other control characters, which names of files and messages of
/// libraries may hold.
[[nodiscard]] std::string one_line(std::string text);

/// The result of a tool: `text` for people, `json` for programs. It is printed once at the end,
/// unless the tool fails.
struct AppResult {
    std::string text;
    JsonValue json = JsonValue::object();
    /// Why the result is incomplete ("interrupted after 3 of 8 faces"); empty if it is complete.
    /// Printed on stderr after the result, and the tool ends with exit code 1.
    std::string incomplete{};
};

/// Values of options by their names ("--steps"), as strings, numbers and booleans.
using Settings = std::vector<std::pair<std::string, JsonValue>>;

using AppBody = std::function<AppResult(const CommonOptions&)>;

/// An option with its value in Command::settings.
struct DeclaredOption {
    CLI::Option* option = nullptr;
    std::function<JsonValue()> value;
    bool keeps_results = false;
    std::vector<std::string> needs_one_of{};
};

/// Refinements of an option that was just declared; may be chained.
class OptionRules {
public:
    explicit OptionRules(DeclaredOption& declared)
        : option_(declared.option), declared_(declared) {}

    OptionRules& required();
    /// The number must be in [low, high]; NaN is rejected.
    OptionRules& range(double low, double high);
    OptionRules& one_of(const std::vector<std::string>& allowed);
    /// The option requires, or excludes, the option `name`, which must have been declared already.
    OptionRules& needs(const std::string& name);
    OptionRules& excludes(const std::string& name);
    /// The option has no effect without at least one of these.
    OptionRules& needs_one_of(std::vector<std::string> names);
    /// The text names a file unless it is `word`.
    OptionRules& file_or(const std::string& word);
    /// The result is the same whatever the value, so the option is not one of Command::settings.
    OptionRules& keeps_results();

private:
    CLI::Option* option_;
    DeclaredOption& declared_;
};

/// The options of a tool or of one of its commands.
class Command {
public:
    explicit Command(CLI::App* app);

    /// "--name" or "-n,--name" for an option, "name" for a positional argument. The current value
    /// of `target` is the default. T: int, std::int64_t, std::uint64_t, double, std::string,
    /// std::filesystem::path, std::optional of one of these (empty unless given),
    /// std::vector<std::string> (the option may be repeated). An empty path is rejected.
    template <class T>
    OptionRules option(const std::string& name, T& target, const std::string& help);
    OptionRules flag(const std::string& name, bool& target, const std::string& help);
    /// Refines an option that was declared before.
    OptionRules refine(const std::string& name);
    /// All options that `declare` declares require the option `name`.
    void requiring(const std::string& name, const std::function<void()>& declare);

    /// Every option on which the result can depend, with the present value of its target, in the
    /// order of declaration: those that are not marked with `keeps_results`. Names of files are
    /// absolute; an optional that is empty is "default".
    [[nodiscard]] Settings settings() const;

private:
    OptionRules declare(CLI::Option* option, std::function<JsonValue()> value);

    CLI::App* app_;
    std::shared_ptr<std::deque<DeclaredOption>> declared_;  ///< shared by copies of this object
};

/// Parses argc and argv of a tool, calls its body, and turns the result into output and an exit
/// code: 0 done; 1 failed or incomplete, with one line "stymo-fit: what, which file or key, what to
/// do" on stderr; 2 wrong usage, with such a line (errors of the parser and UsageError).
class CommandLine : public Command {
public:
    /// `precision` is the default precision of matrix products.
    CommandLine(const std::string& program, const std::string& description,
                MatmulPrecision precision = MatmulPrecision::high);
    ~CommandLine();
    CommandLine(const CommandLine&) = delete;
    CommandLine& operator=(const CommandLine&) = delete;

    /// Adds a command ("mix" of `stymo-edit mix`). Its options are declared on the result, which
    /// must not outlive this object.
    Command command(const std::string& name, const std::string& description, AppBody body);

    /// Parses, sets the number of threads, the precision of products, the allocator and the
    /// handling of subnormal numbers, and calls the body of the given command, or `body` if no
    /// command is given. If `body` is empty, a command is required. Returns the exit code.
    [[nodiscard]] int run(int argc, const char* const* argv, const AppBody& body = {});
    /// Writes to the given streams instead of stdout and stderr.
    [[nodiscard]] int run(int argc, const char* const* argv, const AppBody& body, std::ostream& out,
                          std::ostream& err);

private:
    struct Implementation;

    explicit CommandLine(std::unique_ptr<Implementation> implementation);

    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
