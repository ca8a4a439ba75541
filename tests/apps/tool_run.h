#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "apps/common/child_process.h"

namespace stymo {

/// How a tool ended and what it printed.
struct ToolOutcome {
    int exit_code = -1;  ///< -1: ended by a signal
    std::string out;
    std::string err;
};

/// A new, empty file in the folder for temporary files, deleted at the end.
class TemporaryFile {
public:
    TemporaryFile();
    ~TemporaryFile();
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

/// An executable of the build folder that runs in `folder`, on one thread.
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
    TemporaryFile out_;
    TemporaryFile err_;
};

/// Runs a command such as "stymo-render --out x.png" in `folder`, on one thread unless it says
/// otherwise. No word of it can hold a space. The tool's main function is called in this process,
/// because starting an executable takes longer than most tests.
[[nodiscard]] ToolOutcome run_tool(const std::filesystem::path& folder, const std::string& command);
/// A tool that runs in a copy of this process (fork), on one thread unless its command says
/// otherwise: nothing that happens to the copy is left in this process, and no executable need be
/// started.
class RunningCopy {
public:
    /// `prepare` and `finish` are called in the copy before and after the tool's main function.
    /// Under the leak sanitizer a leak is exit code 23.
    RunningCopy(const std::filesystem::path& folder, const std::string& command,
                const std::function<void()>& prepare = {},
                const std::function<void()>& finish = {});
    ~RunningCopy();
    RunningCopy(const RunningCopy&) = delete;
    RunningCopy& operator=(const RunningCopy&) = delete;

    [[nodiscard]] ToolOutcome wait();

private:
    pid_t process_ = -1;
    TemporaryFile out_;
    TemporaryFile err_;
};
/// Whether mpirun can start processes here. Says so, if not.
[[nodiscard]] bool can_start_ranks();
/// Runs a command such as "mpirun -n 2 ...".
[[nodiscard]] ChildOutcome run_ranks(const std::vector<std::string>& words);
/// The words of a line.
[[nodiscard]] std::vector<std::string> words(const std::string& line);
/// Number of lines of a text.
[[nodiscard]] std::ptrdiff_t line_count(const std::string& text);

}  // namespace stymo
