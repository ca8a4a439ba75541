#include "reliability/calls/outcome_checks.h"

#include <catch2/catch.hpp>
#include <functional>
#include <map>
#include <sstream>

#include "core/io/file.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

/// Stands for what a tool finds in its output folder. Left out are the log and the files of
/// TensorBoard, which hold times, and which no tool reads.
std::string digest(const fs::path& folder) {
    std::map<std::string, std::size_t> files;
    if (fs::exists(folder))
        for (const auto& entry : fs::recursive_directory_iterator(folder)) {
            const std::string name = entry.path().lexically_relative(folder).string();
            if (name == "log.txt" || name.starts_with("events.")) continue;
            files[name] =
                entry.is_regular_file() ? std::hash<std::string>()(read_file(entry.path())) : 0;
        }
    std::string text;
    for (const auto& [name, hash] : files) text += name + ' ' + std::to_string(hash) + '\n';
    return text;
}

/// Without what the leak sanitizer says of threads that a copy of a process does not have.
/// Libraries start some before the main function.
std::string without_thread_warnings(const std::string& text) {
    std::istringstream lines(text);
    std::string rest;
    for (std::string line; std::getline(lines, line);)
        if (line.find("was not suspended. False leaks are possible.") == std::string::npos)
            rest += line + '\n';
    return rest;
}

}  // namespace

void check_says_so(const std::string& command, const ToolOutcome& outcome) {
    const std::string start = words(command).front() + ": ";
    std::string text = without_thread_warnings(outcome.err);
    INFO(text);
    CHECK(outcome.exit_code == 1);
    CHECK(text.ends_with('\n'));
    if (text.empty()) return;
    text.pop_back();
    const std::size_t line = text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1;
    CHECK(text.substr(line).starts_with(start));
    CHECK(text.find(start) == line);
    CHECK(outcome.out.empty());
}

void check_no_temporary_files(const fs::path& folder) {
    if (!fs::exists(folder)) return;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        INFO(entry.path());
        CHECK(entry.path().filename().string().find(".part") == std::string::npos);
    }
}

void FinishedStates::finish(const ShortJob& job, const fs::path& out) {
    if (!seen_.insert(digest(out)).second) return;
    const ToolOutcome again = RunningCopy(short_data(), job.command_to_finish(out)).wait();
    INFO("again: " << again.err);
    const bool complete = again.err.find("exists already") != std::string::npos;
    CHECK((again.exit_code == 0 || complete));
    job.compare(out);
}

}  // namespace stymo
