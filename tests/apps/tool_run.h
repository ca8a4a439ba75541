#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace stymo {

/// How a tool ended and what it printed.
struct ToolOutcome {
    int exit_code = -1;  ///< -1: ended by a signal
    std::string out;
    std::string err;
};

/// A tool that runs in a process of its own, in `folder`, on one thread. The process is a copy of a
/// small part of this program, because loading the libraries anew takes longer than most tests.
/// stymo-bench, which starts itself, and any tool with --version are run as executables of the
/// build folder.
class RunningTool {
public:
    RunningTool(const std::filesystem::path& folder, const std::string& tool,
                std::vector<std::string> arguments);
    /// Ends the tool if it still runs.
    ~RunningTool();
    RunningTool(const RunningTool&) = delete;
    RunningTool& operator=(const RunningTool&) = delete;

    void send(int signal_number) const;
    /// Waits for the tool's stderr to hold `text`; returns false if it ends first or a minute
    /// passes.
    [[nodiscard]] bool says(const std::string& text);
    [[nodiscard]] ToolOutcome wait();

private:
    [[nodiscard]] bool has_ended();

    pid_t process_ = -1;
    int status_ = 0;
    bool ended_ = false;
    std::filesystem::path out_;
    std::filesystem::path err_;
};

/// Runs "stymo-render --out x.png", say: words without spaces in them.
[[nodiscard]] ToolOutcome run_tool(const std::filesystem::path& folder, const std::string& command);
/// The words of a line.
[[nodiscard]] std::vector<std::string> words(const std::string& line);
/// Number of lines of a text.
[[nodiscard]] std::ptrdiff_t line_count(const std::string& text);

}  // namespace stymo
