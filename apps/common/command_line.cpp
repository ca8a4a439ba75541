#include "apps/common/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <iomanip>
#include <iostream>
#include <map>
#include <new>
#include <set>
#include <sstream>
#include <type_traits>

#include "apps/common/explain.h"
#include "apps/common/process_setup.h"
#include "core/kernels/targets.h"
#include "core/parallel.h"
#include "core/subnormals.h"
#include "fit/photo/face_detector.h"

namespace stymo {
namespace {

constexpr int exit_done = 0;
constexpr int exit_failed = 1;
constexpr int exit_wrong_usage = 2;

template <class T>
constexpr bool is_optional = false;
template <class T>
constexpr bool is_optional<std::optional<T>> = true;

/// The number that the whole of `text` represents, or nothing.
std::optional<double> number_in(const std::string& text) {
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0') return std::nullopt;
    return number;
}

CLI::Validator in_range(double low, double high) {
    std::ostringstream range;
    range << "in [" << std::setprecision(12) << low << ", " << high << "]";
    const auto problem = [low, high, range = range.str()](const std::string& text) -> std::string {
        const std::optional<double> number = number_in(text);
        return number && *number >= low && *number <= high ? ""
                                                           : text + " is not a number " + range;
    };
    return {problem, range.str()};
}

constexpr const char* unwritten_output =
    "the result could not be written to the standard output; is the disk full?";

/// Throws CLI::RequiresError for an option that was given without any of those it needs.
void require_one_of(const CLI::App& app, const DeclaredOption& declared) {
    const std::vector<std::string>& needed = declared.needs_one_of;
    if (needed.empty() || std::ranges::any_of(needed, [&](const std::string& name) {
            return app.get_option(name)->count() > 0;
        }))
        return;
    std::string names;
    for (const std::string& name : needed) names += (names.empty() ? "" : " or ") + name;
    throw CLI::RequiresError(declared.option->get_name(), names);
}

/// Throws CLI::ConversionError for an option such as `--out=`: the parser would take the next word
/// as its value.
void require_values(int argc, const char* const* argv) {
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (word.starts_with("--") && word.ends_with('=') && word.find('=') + 1 == word.size())
            throw CLI::ConversionError(word.substr(0, word.size() - 1) + ": the value is empty");
    }
}

/// The error message for a call without an existing command, for a tool that requires one.
std::string missing_command(const CLI::App& app, int argc, const char* const* argv) {
    std::string names;
    for (const CLI::App* command : app.get_subcommands(nullptr))
        names += (names.empty() ? "" : ", ") + command->get_name();
    const std::string first = argc > 1 ? argv[1] : "";
    if (first.empty() || first.starts_with('-')) return "a command is required: " + names;
    return "there is no command " + first + "; give one of " + names;
}

const char* vector_instructions() {
#if defined(__AVX512F__)
    return "AVX-512";
#elif defined(__AVX2__)
    return "AVX2";
#elif defined(__SSE2__)
    return "SSE2";
#elif defined(__ARM_NEON)
    return "NEON";
#else
    return "none";
#endif
}

#ifdef STYMO_WITH_MPI
constexpr const char* several_machines = "Open MPI";
#else
constexpr const char* several_machines = "off (built without Open MPI)";
#endif

std::string version_text(const std::string& program) {
    std::ostringstream text;
    text << program << " " << STYMO_VERSION << "\nthreads: " << thread_count()
         << "\nvector instructions: " << vector_instructions()
         << " (kernels: " << kernels::chosen_target() << ")"
         << "\nproducts of bfloat16: " << bfloat16_instructions() << "\nfaces in photos: "
         << (FaceDetector::available() ? "dlib" : "off (built without dlib)")
         << "\nseveral machines: " << several_machines;
    return text.str();
}

template <class T>
constexpr bool is_text =
    std::is_same_v<T, std::string> || std::is_same_v<T, std::optional<std::string>> ||
    std::is_same_v<T, std::vector<std::string>>;

std::string absolute_text(const std::filesystem::path& path) {
    return path.empty() ? std::string() : std::filesystem::absolute(path).string();
}

template <class T>
JsonValue setting_of(const T& value) {
    if constexpr (is_optional<T>) {
        return value ? setting_of(*value) : JsonValue("default");
    } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
        return absolute_text(value);
    } else {
        return value;
    }
}

}  // namespace

OptionRules& OptionRules::required() {
    option_->required();
    return *this;
}

OptionRules& OptionRules::range(double low, double high) {
    option_->check(in_range(low, high));
    return *this;
}

OptionRules& OptionRules::one_of(const std::vector<std::string>& allowed) {
    option_->check(CLI::IsMember(allowed));
    return *this;
}

OptionRules& OptionRules::needs(const std::string& name) {
    option_->needs(name);
    return *this;
}

OptionRules& OptionRules::excludes(const std::string& name) {
    option_->excludes(name);
    return *this;
}

OptionRules& OptionRules::needs_one_of(std::vector<std::string> names) {
    declared_.needs_one_of = std::move(names);
    return *this;
}

OptionRules& OptionRules::file_or(const std::string& word) {
    declared_.value = [option = option_, word] {
        const std::string text =
            option->count() > 0 ? option->results().front() : option->get_default_str();
        return text == word ? text : absolute_text(text);
    };
    return *this;
}

OptionRules& OptionRules::keeps_results() {
    declared_.keeps_results = true;
    return *this;
}

Command::Command(CLI::App* app)
    : app_(app), declared_(std::make_shared<std::deque<DeclaredOption>>()) {
    app->parse_complete_callback([app, declared = declared_] {
        for (const DeclaredOption& option : *declared)
            if (option.option->count() > 0) require_one_of(*app, option);
    });
}

OptionRules Command::declare(CLI::Option* option, std::function<JsonValue()> value) {
    return OptionRules(declared_->emplace_back(DeclaredOption{option, std::move(value)}));
}

OptionRules Command::refine(const std::string& name) {
    const CLI::Option* const option = app_->get_option(name);
    const auto declared = std::ranges::find(*declared_, option, &DeclaredOption::option);
    return OptionRules(*declared);
}

void Command::requiring(const std::string& name, const std::function<void()>& declare) {
    const auto before = std::ssize(*declared_);
    declare();
    std::for_each(declared_->begin() + before, declared_->end(),
                  [&name](const DeclaredOption& declared) { declared.option->needs(name); });
}

Settings Command::settings() const {
    Settings settings;
    for (const DeclaredOption& declared : *declared_)
        if (!declared.keeps_results)
            settings.emplace_back(declared.option->get_name(), declared.value());
    return settings;
}

template <class T>
OptionRules Command::option(const std::string& name, T& target, const std::string& help) {
    const auto value = [&target] { return setting_of(target); };
    if constexpr (std::is_same_v<T, std::filesystem::path> ||
                  std::is_same_v<T, std::optional<std::filesystem::path>>) {
        // CLI11 treats a path as a list of paths.
        auto* option = app_->add_option_function<std::string>(
            name, [&target](const std::string& text) { target = std::filesystem::path(text); },
            help);
        if constexpr (!is_optional<T>) option->default_str(target.string());
        const auto problem = [](const std::string& text) -> std::string {
            return text.empty() ? "the path is empty" : "";
        };
        option->check(CLI::Validator(problem, ""));
        return declare(option->type_name("PATH"), value);
    } else {
        auto* option = app_->add_option(name, target, help);
        if constexpr (is_text<T>) {
            const auto problem = [](const std::string& text) -> std::string {
                return text.empty() ? "the value is empty" : "";
            };
            option->check(CLI::Validator(problem, ""));
        }
        if constexpr (std::is_same_v<T, std::vector<std::string>>) {
            option->allow_extra_args(false);
        } else if constexpr (!is_optional<T>) {
            option->capture_default_str();
        }
        if constexpr (std::is_same_v<T, std::uint64_t> ||
                      std::is_same_v<T, std::optional<std::uint64_t>>) {
            // The conversion reads "-1", and what is too large, as the largest number.
            const auto problem = [](const std::string& text) -> std::string {
                if (text.starts_with('-')) return text + " is negative";
                std::uint64_t number = 0;
                const auto [last, error] =
                    std::from_chars(text.data(), text.data() + text.size(), number);
                return error == std::errc::result_out_of_range || text.starts_with(' ')
                           ? text + " is no whole number below 18446744073709551616"
                           : "";
            };
            option->check(CLI::Validator(problem, ""));
        }
        return declare(option, value);
    }
}

template OptionRules Command::option(const std::string&, int&, const std::string&);
template OptionRules Command::option(const std::string&, std::int64_t&, const std::string&);
template OptionRules Command::option(const std::string&, std::uint64_t&, const std::string&);
template OptionRules Command::option(const std::string&, double&, const std::string&);
template OptionRules Command::option(const std::string&, std::string&, const std::string&);
template OptionRules Command::option(const std::string&, std::filesystem::path&,
                                     const std::string&);
template OptionRules Command::option(const std::string&, std::vector<std::string>&,
                                     const std::string&);
template OptionRules Command::option(const std::string&, std::optional<int>&, const std::string&);
template OptionRules Command::option(const std::string&, std::optional<std::int64_t>&,
                                     const std::string&);
template OptionRules Command::option(const std::string&, std::optional<std::uint64_t>&,
                                     const std::string&);
template OptionRules Command::option(const std::string&, std::optional<double>&,
                                     const std::string&);
template OptionRules Command::option(const std::string&, std::optional<std::string>&,
                                     const std::string&);
template OptionRules Command::option(const std::string&, std::optional<std::filesystem::path>&,
                                     const std::string&);

OptionRules Command::flag(const std::string& name, bool& target, const std::string& help) {
    return declare(app_->add_flag(name, target, help), [&target] { return JsonValue(target); });
}

namespace {

/// The first option of the tool itself that stands beside a command and is none of the common ones;
/// empty if there is none.
std::string stray_option(const CLI::App& app, const std::set<const CLI::Option*>& common) {
    for (const CLI::Option* const option : app.get_options())
        if (option->count() > 0 && !common.contains(option)) return option->get_name();
    return {};
}

}  // namespace

std::string one_line(std::string text) {
    for (char& letter : text) {
        if (letter == '\n') letter = ' ';
        if (std::iscntrl(static_cast<unsigned char>(letter)) != 0) letter = '?';
    }
    text.erase(text.find_last_not_of(' ') + 1);
    return text;
}

struct CommandLine::Implementation {
    Implementation(const std::string& program, const std::string& description,
                   MatmulPrecision precision)
        : app(description, program) {
        common.matmul_precision = name_of(precision);
    }

    CLI::App app;
    CommonOptions common;
    std::set<const CLI::Option*> common_options;  ///< which commands have, too
    std::map<const CLI::App*, AppBody> bodies;
};

CommandLine::CommandLine(const std::string& program, const std::string& description,
                         MatmulPrecision precision)
    : CommandLine(std::make_unique<Implementation>(program, description, precision)) {}

CommandLine::CommandLine(std::unique_ptr<Implementation> implementation)
    : Command(&implementation->app), implementation_(std::move(implementation)) {
    auto& [app, common, common_options, bodies] = *implementation_;
    app.set_help_flag("-h,--help", "print this help");
    app.set_version_flag(
        "--version", [name = app.get_name()] { return version_text(name); },
        "print version and build");
    option("--threads", common.threads, "number of threads, 0: one per processor")
        .range(0, most_threads)
        .keeps_results();
    option("--matmul-precision", common.matmul_precision,
           "float32 products as float32 (highest), as pairs of bfloat16 where the processor has "
           "matrix "
           "tiles (high), or as bfloat16 where it has instructions for them (medium)")
        .one_of({"highest", "high", "medium"});
    option("--seed", common.seed, "seed of all random numbers");
    flag("--json", common.json, "print the result as one JSON object").keeps_results();
    flag("--explain", common.explain,
         "print on stderr which networks were made, which losses were evaluated, and counts of the "
         "work done; also in --json")
        .keeps_results();
    const std::vector<CLI::Option*> options = app.get_options();
    common_options.insert(options.begin(), options.end());
    app.fallthrough();  // common options may stand behind a command's name
}

CommandLine::~CommandLine() = default;

Command CommandLine::command(const std::string& name, const std::string& description,
                             AppBody body) {
    implementation_->app.set_help_all_flag("--help-all",
                                           "print this help and that of all commands");
    CLI::App* command = implementation_->app.add_subcommand(name, description);
    implementation_->bodies[command] = std::move(body);
    return Command(command);
}

int CommandLine::run(int argc, const char* const* argv, const AppBody& body) {
    return run(argc, argv, body, std::cout, std::cerr);
}

int CommandLine::run(int argc, const char* const* argv, const AppBody& body, std::ostream& out,
                     std::ostream& err) {
    auto& [app, common, common_options, bodies] = *implementation_;
    const auto report = [&err, &name = app.get_name()](const std::string& message) {
        err << name << ": " << one_line(message) << "\n";
    };
    tune_allocator();
    flush_subnormals();
    // A file that exceeds the limit of the system is an error like any other.
    std::signal(SIGXFSZ, SIG_IGN);
    app.require_subcommand(body ? 0 : 1, bodies.empty() ? 0 : 1);
    try {
        require_values(argc, argv);
        app.parse(argc, argv);
    } catch (const CLI::Success& request) {
        app.exit(request, out, err);
        out.flush();
        if (out) return exit_done;
        report(unwritten_output);
        return exit_failed;
    } catch (const CLI::RequiredError& error) {
        const bool lacks_command = !body && app.get_subcommands().empty();
        report((lacks_command ? missing_command(app, argc, argv) : error.what()) + "; see " +
               app.get_name() + " --help");
        return exit_wrong_usage;
    } catch (const CLI::Error& error) {
        report(std::string(error.what()) + "; see " + app.get_name() + " --help");
        return exit_wrong_usage;
    }
    const auto commands = app.get_subcommands();
    if (const std::string stray = commands.empty() ? "" : stray_option(app, common_options);
        !stray.empty()) {
        report(stray + " is no option of " + app.get_name() + " " + commands.front()->get_name() +
               "; see " + app.get_name() + " " + commands.front()->get_name() + " --help");
        return exit_wrong_usage;
    }
    try {
        set_thread_count(common.threads);
        const MatmulPrecision precision = matmul_precision_of(common.matmul_precision);
        set_matmul_precision(precision);
        if (app.count("--matmul-precision") > 0 && computed_precision(precision) != precision)
            report("warning: this processor has no instructions for --matmul-precision " +
                   common.matmul_precision + ", which computes in float32");
        const AppBody& chosen = commands.empty() ? body : bodies.at(commands.front());
        const auto work = [&] { return chosen(common); };
        const AppResult result = common.explain ? explained(work, err) : work();
        if (common.json) {
            out << result.json.text() << "\n";
        } else if (!result.text.empty()) {
            out << result.text << (result.text.back() == '\n' ? "" : "\n");
        }
        out.flush();
        if (!out) fail<FileError>(unwritten_output);
        if (result.incomplete.empty()) return exit_done;
        report(result.incomplete);
    } catch (const UsageError& error) {
        report(std::string(error.what()) + "; see " + app.get_name() + " --help");
        return exit_wrong_usage;
    } catch (const std::bad_alloc&) {
        report("out of memory; choose a smaller size or batch");
    } catch (const std::exception& error) {
        report(error.what());
    }
    return exit_failed;
}

}  // namespace stymo
